"""Say in a prompt where the arm reaches.

Covered by `tests/core/designs/test_composer.py`.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from core.geometry import Pose
from core.robot.kinematics import arm
from core.robot.reach import as_table, compute_reach, describe_limits, turns_at


class ArmSheet(NamedTuple):
    """What templates may say of the arm: ``reach`` a table, ``turns`` by roll, pitch and yaw at home, ``joints`` there.

    ``limits`` says what binds at the reach's inner edge.
    """

    reach: str
    limits: str
    turns: str
    joints: str


def describe_arm(home: Pose) -> ArmSheet:
    """Describe the arm that starts with its end-effector at ``home``."""
    return _sheet(tuple(home.position.tolist()), tuple(home.quaternion.tolist()))


@lru_cache(maxsize=16)
def _sheet(position: tuple[float, ...], quaternion: tuple[float, ...]) -> ArmSheet:
    robot, home = arm(), Pose(np.array(position), np.array(quaternion))
    reach = compute_reach(robot)
    turns = zip(("roll", "pitch", "yaw"), turns_at(robot, home.position), strict=True)
    return ArmSheet(
        as_table(reach),
        describe_limits(reach),
        ", ".join(f"{name} from {least:.1f} to {most:.1f}" for name, (least, most) in turns),
        ", ".join(f"{angle + 0.0:.2f}" for angle in robot.home_for(home).round(2)),
    )

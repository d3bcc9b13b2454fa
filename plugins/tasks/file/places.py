"""Find where a goal takes bodies, and whether an arm with a tool gets there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from core.geometry import Array, Pose
from core.goals import Reach
from core.robot.kinematics import Arm
from core.scene import Scene, State

TOOL_M = 0.8  # the longest tool that most arms can wield


def find_far(goal: Reach, arm: Arm, scene: Scene) -> Iterator[str]:
    """Yield a line for each body of a goal that is out of an arm's reach, or is to be where that is so."""
    state = scene.state()
    for name in goal.bodies:
        ends = find_ends(goal, name, state)
        away = max(arm.inverse(Pose(end), arm.home).error_m for end in ends)
        if away > TOOL_M:
            yield (
                f"{name}, or where it is to be, is out of reach, {away:.2f} m from where the flange gets; are "
                "these metres?"
            )


def find_ends(goal: Reach, name: str, state: State) -> tuple[Array, Array]:
    """Return where a body is, and where a goal wants it, (3,) each; where it wants nothing, it stays."""
    here = state.position(name)
    wanted = goal.place_of(name, state)
    if wanted is None:
        return here, here

    return here, np.where(np.isnan(wanted), here, wanted)

"""Compute where the end-effector can be, with the inverse kinematics that motions use."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from itertools import count

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array, Pose
from core.interfaces import JointTrajectory
from core.robot.frames import robot_model
from core.robot.kinematics import Arm, Solution
from core.solids.self_collision import find_self_collision

PITCHES = (-0.8, -0.5, 0.0, 0.5, 0.8)
_RISE_M = 0.1  # between two heights
_STEP_M, _STEP_RAD = 0.02, 0.1
_NEAR_M, _NEAR_RAD = 0.003, 0.02  # a pose missed by less counts as reached


@dataclass(frozen=True)
class Span:
    """The smallest and largest distances from the base's axis that are reached, metres."""

    least: float
    most: float


Row = dict[float, Span | None]  # by pitch; None: nothing is reached


@lru_cache(maxsize=4)
def compute_reach(arm: Arm, pitches: tuple[float, ...] = PITCHES) -> dict[float, Row]:
    """Compute the reach straight ahead of the base, at its yaw and roll = 0, by height from z = 0 up and by pitch.

    Distances are those from the base's axis, heights those in the world. A pose counts as reached if the inverse
    kinematics comes near it from the pose beside it, and the arm is clear of itself there. Distances are rounded
    inwards to 2 cm.
    """
    table: dict[float, Row] = {}
    home = max(0, round(float(arm.forward(arm.home).position[2]) / _RISE_M))
    for numbers in (count(home), range(home - 1, -1, -1)):
        for number in numbers:
            height = round(number * _RISE_M, 3)
            row = {pitch: span_at(arm, height, pitch) for pitch in pitches}
            if not any(row.values()):
                break
            table[height] = row
    return dict(sorted(table.items()))


def span_at(arm: Arm, height: float, pitch: float) -> Span | None:
    """Find the distances that are reached at this height and pitch: out from near home's, and back in from there."""
    x, y, _ = arm.robot.base.position
    base = Pose.xyz_rpy((x, y, 0.0), (0.0, 0.0, arm.robot.base.rpy[2]))
    farthest = int(robot_model(arm.robot, False).reach / _STEP_M)
    home = round(float(np.hypot(*base.inverse().apply(arm.forward(arm.home).position)[:2])) / _STEP_M)
    turn = Rotation.from_euler("y", pitch)
    poses = [base @ Pose.from_rotation((step * _STEP_M, 0.0, height), turn) for step in range(farthest)]
    for first in sorted(range(farthest), key=lambda step: abs(step - home)):
        start = arm.inverse(poses[first], arm.home)
        if _is_near(start) and not _clear(arm, [start.joints] * 2):
            break
    else:
        return None
    out = _march(arm, poses[first + 1 :], start.joints)
    out = out[: _clear(arm, out) or None]
    most = first + len(out) - 1
    back = _march(arm, poses[:most][::-1], out[-1])
    back = back[: _clear(arm, back) or None]
    return Span((most - len(back) + 1) * _STEP_M, most * _STEP_M)


def turns_at(arm: Arm, home: Pose) -> tuple[tuple[float, float], ...]:
    """Find how far the end-effector turns from ``home`` about the world's x, y or z alone: least and most, radians."""
    start, angles = arm.home_for(home), np.arange(1, int(np.pi / _STEP_RAD) + 1) * _STEP_RAD

    def most(axis: Array) -> float:
        turned = [Rotation.from_rotvec(axis * angle) * home.rotation for angle in angles]
        way = _march(arm, [Pose.from_rotation(home.position, turn) for turn in turned], start)
        return float(((_clear(arm, way) or len(way)) - 1) * _STEP_RAD)

    return tuple((-most(-axis), most(axis)) for axis in np.eye(3))


def _march(arm: Arm, poses: Iterable[Pose], seed: Array) -> list[Array]:
    """Go from pose to pose while they are reached: the joints, from ``seed`` on."""
    way = [seed]
    for pose in poses:
        solution = arm.inverse(pose, way[-1])
        if not _is_near(solution):
            break
        way.append(solution.joints)
    return way


def _is_near(solution: Solution) -> bool:
    return solution.error_m < _NEAR_M and solution.error_rad < _NEAR_RAD


def _clear(arm: Arm, way: list[Array]) -> int:
    """Count the joints before the arm meets itself on the way, at least 1; 0 if it does not."""
    still = JointTrajectory(np.arange(float(len(way))), np.array(way), np.zeros(len(way)))
    met = find_self_collision(arm.robot, Tool(), still)
    return 0 if met is None else max(1, int(np.ceil(met.time_s)))


def as_table(reach: dict[float, Row]) -> str:
    """Write the reach as a Markdown table in centimetres, a row for each height in metres."""
    pitches = list(next(iter(reach.values()), {}))
    lines = [["z", *(f"{pitch:g}" for pitch in pitches)], ["-"] * (len(pitches) + 1)]
    for height, row in reach.items():
        spans = [f"{100 * span.least:.0f}-{100 * span.most:.0f}" if span else "none" for span in row.values()]
        lines.append([f"{height:g}", *spans])
    return "\n".join(f"|{'|'.join(cells)}|" for cells in lines)

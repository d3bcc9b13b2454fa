"""Measure where an arm reaches, and how far it turns."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import count

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array, Pose
from core.interfaces import JointTrajectory
from core.robot.kinematics import Arm, robot_model
from core.solids.self_collision import find_self_collision

PITCHES = (-0.8, -0.5, 0.0, 0.5, 0.8)
_RISE_M = 0.1  # between two heights
_STEP_M = 0.02
_STEP_RAD = 0.1
_NEAR_M = 0.003  # a pose missed by less counts as reached,
_NEAR_RAD = 0.02


@dataclass(frozen=True)
class Span:
    """The smallest and largest distances from the base's axis that are reached, metres.

    Attributes:
        least: 0 or more.
        most: not less than ``least``.
    """

    least: float
    most: float


Row = dict[float, Span | None]
"""What is reached at a height, by pitch; None: nothing."""


@lru_cache(maxsize=4)
def compute_reach(arm: Arm, pitches: tuple[float, ...] = PITCHES) -> dict[float, Row]:
    """Compute the reach straight ahead of the base, at its yaw and roll = 0, by height from z = 0 up and by pitch.

    Distances are those from the base's axis, heights those in the world. A pose counts as reached if the inverse
    kinematics comes near it from the pose beside it, and the arm is clear of itself there. Distances are rounded
    inwards to 2 cm.

    Args:
        arm: with its base where it stands.
        pitches: of the end-effector, radians.
    """
    reach: dict[float, Row] = {}
    home = max(0, round(float(arm.forward(arm.home).position[2]) / _RISE_M))

    for numbers in (count(home), range(home - 1, -1, -1)):
        for number in numbers:
            height = round(number * _RISE_M, 3)
            row = {pitch: span_at(arm, height, pitch) for pitch in pitches}

            if not any(row.values()):
                break

            reach[height] = row

    return dict(sorted(reach.items()))


def span_at(arm: Arm, height: float, pitch: float) -> Span | None:
    """Find the distances that are reached at this height and turn: out from near home's, and back in from there.

    The search begins at the distance of home and goes on to those that are farther from it, until one is reached.

    Args:
        arm: with its base where it stands.
        height: of the end-effector in the world, metres.
        pitch: of the end-effector, radians.

    Returns:
        None if no distance is reached.
    """
    base = arm.robot.base
    x, y, _ = base.position
    axis = Pose.xyz_rpy((x, y, 0.0), (0.0, 0.0, base.rpy[2]))
    count = int(robot_model(arm.robot, Tool()).reach / _STEP_M)
    ahead = np.full((count, 3), [0.0, 0.0, height])
    ahead[:, 0] = _STEP_M * np.arange(count)
    places = axis.apply(ahead)
    turned = (axis.rotation * Rotation.from_euler("y", pitch)).as_matrix()
    turns = np.broadcast_to(turned, (count, 3, 3))

    home = axis.inverse().apply(arm.forward(arm.home).position)
    nearest = round(float(np.hypot(*home[:2])) / _STEP_M)

    for first in sorted(range(count), key=lambda step: abs(step - nearest)):
        start = _reach(arm, places[first], turned, arm.home)
        if start is not None and _find_meeting(arm, [start] * 2) is None:
            break
    else:
        return None

    out = _march(arm, places[first + 1 :], turns, start)
    most = first + len(out) - 1
    back = _march(arm, places[:most][::-1], turns, out[-1])
    return Span((most - len(back) + 1) * _STEP_M, most * _STEP_M)


def turns_at(arm: Arm, home: Pose) -> list[tuple[float, float]]:
    """Find how far the end-effector turns from ``home`` about the world's x, y or z alone: least and most, radians.

    Args:
        arm: with its base where it stands.
        home: pose of the end-effector.
    """
    return [
        (-_turn_about(arm, home, -axis), _turn_about(arm, home, axis))
        for axis in np.eye(3)
    ]


def _turn_about(arm: Arm, home: Pose, axis: Array) -> float:
    """Find how far the end-effector turns about an axis (3,), radians.

    Args:
        arm: with its base where it stands.
        home: pose of the end-effector, which keeps its place.
        axis: of the world, (3,).
    """
    angles = _STEP_RAD * np.arange(1, int(np.pi / _STEP_RAD) + 1)
    turns = (Rotation.from_rotvec(angles[:, None] * axis) * home.rotation).as_matrix()
    places = np.broadcast_to(home.position, (len(angles), 3))
    way = _march(arm, places, turns, arm.home_for(home))
    return float((len(way) - 1) * _STEP_RAD)


def _march(arm: Arm, places: Array, turns: Array, seed: Array) -> list[Array]:
    """Go from pose to pose while they are reached and the arm is clear of itself: the joints, from ``seed`` on.

    Args:
        arm: which has to reach the poses.
        places: of the end-effector (K, 3), near each other.
        turns: of the end-effector (K, 3, 3), or more.
        seed: joints before the first pose, (J,).
    """
    way = [seed]
    for place, turn in zip(places, turns, strict=False):
        joints = _reach(arm, place, turn, way[-1])
        if joints is None:
            break

        way.append(joints)

    met_s = _find_meeting(arm, way)
    if met_s is not None:
        del way[max(1, int(np.ceil(met_s))) :]

    return way


def _reach(arm: Arm, place: Array, turn: Array, seed: Array) -> Array | None:
    """Return the joints (J,) near ``seed`` with the end-effector at a place (3,), turned so (3, 3); None: none do that.

    It has no `Pose`: thousands of them would take half of the time.
    """
    joints, errors = arm.follow(place[None], turn[None], seed)
    missed_m, missed_rad = errors[0]
    is_near = missed_m < _NEAR_M and missed_rad < _NEAR_RAD
    return joints[0] if is_near else None


def _find_meeting(arm: Arm, way: list[Array]) -> float | None:
    """Find when the arm meets itself where it takes a second from each of these joints to the next; None: never.

    Args:
        arm: without a tool.
        way: joints (J,) of each place.
    """
    seconds = np.arange(float(len(way)))
    motion = JointTrajectory(seconds, np.array(way), np.zeros(len(way)))
    met = find_self_collision(arm.robot, Tool(), motion)
    return None if met is None else met.time_s

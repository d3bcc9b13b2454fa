"""Say in a prompt where the arm stands and reaches, how fast and exact it is, and what a tool meets at the mount."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import count
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.designs.statics import moment_limit
from core.geometry import Array, Pose
from core.interfaces import Brief, JointTrajectory, Robot, RolloutSettings, Task
from core.robot.extents import Finger, fingers_of
from core.robot.kinematics import Arm, Solution, arm_of, robot_model
from core.robot.trajectory import plan_motion
from core.solids.self_collision import find_self_collision
from core.support.text import short_number, short_numbers, table
from plugins.vlms.told.outline import extents_at_home

WAYS = ("forward", "left", "up")
LENGTHS_M = (0.1, 0.2, 0.4)
_EACH_M = 0.6  # up to here each height is shown, above it every other
_AT_WILL_RAD = 2.8  # nearly half a turn to both sides
_SAMPLES = 400
_LEVEL_M = 0.001
_SIDES = (
    ("to the front", "to the left", "up"),
    ("to the back", "to the right", "down"),
)  # along x, y, z, and reversed
PITCHES = (-0.8, -0.5, 0.0, 0.5, 0.8)
_RISE_M = 0.1  # between two heights
_STEP_M = 0.02
_STEP_RAD = 0.1
_NEAR_M = 0.003  # a pose missed by less counts as reached,
_NEAR_RAD = 0.02


class Segment(NamedTuple):
    """A straight way through home: direction, metres, seconds, and the ratio of its peak speed to its mean."""

    way: str
    length: float
    seconds: float
    peak: float


class FingerSheet(NamedTuple):
    """A finger of the open gripper, as the tool mount has it."""

    name: str  # of its link
    origin: str  # of its frame
    axes: tuple[str, ...]  # where its x, y and z point
    below: str  # how far below the mount it ends, metres


class ArmSheet(NamedTuple):
    """The arm's facts for templates."""

    at: str  # where its base stands, x, y and z; empty at the world's origin
    yaw: str  # how the base is turned; empty if it is not
    reach: str  # a table
    turns: str  # how far it turns by roll, pitch and yaw at home, and with which torque
    joints: str  # their values at home
    speed: str  # a sentence
    exactness: str  # sentences; empty if it was not measured
    around: str  # a table of the links around the mount at home, in its frame
    clear: bool  # whether all of these but the gripper are above the mount
    bearers: tuple[str, ...]  # the links among these that a rigid tool may overlap
    fingers: tuple[FingerSheet, ...]


def told(
    brief: Brief, mounted: Tool, rollout: RolloutSettings, engine: str
) -> ArmSheet:
    """Describe the arm for templates: their ``arm``."""
    return describe_arm(brief.task, rollout, engine, brief.gripper)


def describe_arm(
    task: Task, rollout: RolloutSettings, engine: str, gripper: bool
) -> ArmSheet:
    """Describe the arm at the task's home, in the engine of this name, with its gripper or without.

    Raises:
        UserError: the arm can't reach the task's home.
    """
    return _sheet(task.robot, task.home, rollout, engine, gripper)


@lru_cache(maxsize=16)
def _sheet(
    robot: Robot, home: Pose, rollout: RolloutSettings, engine: str, gripper: bool
) -> ArmSheet:
    arm = arm_of(robot)
    yaw = robot.base.rpy[2]
    reach = {
        z: row
        for z, row in compute_reach(arm).items()
        if z <= _EACH_M or round(10 * z) % 2 == 0
    }
    turns = zip(("roll", "pitch", "yaw"), turns_at(arm, home), strict=True)
    turn = ", ".join(f"{name} {_turn(*ends)}" for name, ends in turns)
    around = extents_at_home(robot, gripper, home)
    bare = extents_at_home(robot, False, home)
    rows = [
        (name, *(_range(*ends) for ends in zip(*extent, strict=True)))
        for name, extent in around.items()
    ]
    return ArmSheet(
        at=short_numbers(robot.base.position, 4, ", ") if robot.base != Pose() else "",
        yaw=short_number(yaw, 4) if yaw else "",
        reach=as_table(reach),
        turns=f"{turn}, with {moment_limit(robot):g} N m",
        joints=short_numbers(arm.home_for(home), 2, ", "),
        speed=describe_speed(segments(arm, home, rollout)),
        exactness=describe_exactness(robot.measured, engine),
        around=table(("link", "x", "y", "z"), rows),
        clear=all(low[2] > -_LEVEL_M for low, _ in bare.values()),
        bearers=tuple(name for name in robot.near_mount if name in bare),
        fingers=tuple(_describe_finger(finger) for finger in fingers_of(robot)),
    )


def _describe_finger(finger: Finger) -> FingerSheet:
    origin = short_numbers(finger.pose.position, 4, ", ")
    axes = tuple(_side(axis) for axis in finger.pose.rotation.as_matrix().T)
    return FingerSheet(
        finger.name, origin, axes, short_number(-finger.place(finger.tip)[2], 3)
    )


def _range(low: float, high: float) -> str:
    return f"{short_number(low, 3)} to {short_number(high, 3)}"


def _side(way: Array) -> str:
    """Say where an axis (3,) points in the frame of the tool mount."""
    axis = int(np.abs(way).argmax())
    aligned = abs(way[axis]) > 1 - 1e-4  # within a degree
    return (
        _SIDES[int(way[axis] < 0)][axis]
        if aligned
        else f"along ({short_numbers(way, 3, ', ')})"
    )


def _turn(least: float, most: float) -> str:
    return (
        "at will" if min(-least, most) > _AT_WILL_RAD else f"{least:.1f} to {most:.1f}"
    )


def segments(arm: Arm, home: Pose, rollout: RolloutSettings) -> list[Segment]:
    """Time straight segments around home."""
    found = []
    for axis, way in zip(np.eye(3), WAYS, strict=True):
        for length in LENGTHS_M:
            ends = [
                [*(home.position + side * length / 2 * axis), *home.rpy]
                for side in (-1, 1)
            ]
            motion = plan_motion(
                np.array(ends),
                home,
                arm,
                segment_s=rollout.segment_s,
                speed=rollout.speed,
            )
            first, last = motion.arrivals.tolist()
            joints, _ = motion.trajectory.sample(np.linspace(first, last, _SAMPLES))
            steps = np.linalg.norm(np.diff(arm.positions(joints), axis=0), axis=1)
            found.append(
                Segment(way, length, last - first, float(steps.max() / steps.mean()))
            )
    return found


def describe_speed(segments: Sequence[Segment]) -> str:
    """Say how long segments take, and how much faster than on average they are at most."""
    times = []
    for length in (LENGTHS_M[0], LENGTHS_M[-1]):
        seconds = (f"{one.seconds:.2g}" for one in segments if one.length == length)
        times.append(f"{'/'.join(seconds)} s for {length:g} m")
    least = min(one.peak for one in segments)
    most = max(one.peak for one in segments)
    return (
        f"Segments {'/'.join(WAYS)} through home take {', '.join(times)}, with a peak speed of {least:.2g} to "
        f"{most:.2g} times the mean"
    )


def short(figure: float) -> str:
    """Write a figure with two digits, and no fewer before the point."""
    return f"{figure:.2g}" if abs(figure) < 99.5 else f"{figure:.0f}"


def describe_exactness(
    measured: Mapping[str, Mapping[str, float | None]], engine: str
) -> str:
    """Say how exact the arm is in this engine; empty where it was not measured."""
    if engine not in measured:
        return ""
    said = {
        name: short(figure)
        for name, figure in measured[engine].items()
        if figure is not None
    }
    force = (
        f"{said['push_n_per_mm']} N per mm"
        if "push_n_per_mm" in said
        else "full force at once"
    )
    turn = measured[engine]["turn_nm_per_rad"]
    torque = "full torque at once" if turn is None else f"{turn:.0f} N m per rad"
    return (
        f"Measured in {engine}: in motion it lags by up to {said['lag_mm']} mm, with 1 kg mounted by "
        f"{said['lag_mm_1kg']} mm; at rest it misses by {said['rest_mm']} mm, under a load of 1 kg by "
        f"{said['sag_mm_1kg']} mm. Held back, it presses with {force}, {said['most_n']} N at most; turned back, it "
        f"turns with {torque}. Sent 2 mm into the table and 0.1 m along it, it ends {said['slid_miss_mm']} mm behind"
    )


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
    """Find the distances that are reached at this height and turn: out from near home's, and back in from there."""
    x, y, _ = arm.robot.base.position
    base = Pose.xyz_rpy((x, y, 0.0), (0.0, 0.0, arm.robot.base.rpy[2]))
    farthest = int(robot_model(arm.robot, Tool()).reach / _STEP_M)
    home = round(
        float(np.hypot(*base.inverse().apply(arm.forward(arm.home).position)[:2]))
        / _STEP_M
    )
    turn = Rotation.from_euler("y", pitch)
    poses = [
        base @ Pose.from_rotation((step * _STEP_M, 0.0, height), turn)
        for step in range(farthest)
    ]
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
    start, angles = (
        arm.home_for(home),
        np.arange(1, int(np.pi / _STEP_RAD) + 1) * _STEP_RAD,
    )

    def most(axis: Array) -> float:
        turned = [
            Rotation.from_rotvec(axis * angle) * home.rotation for angle in angles
        ]
        way = _march(
            arm, [Pose.from_rotation(home.position, turn) for turn in turned], start
        )
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
    still = JointTrajectory(
        np.arange(float(len(way))), np.array(way), np.zeros(len(way))
    )
    met = find_self_collision(arm.robot, Tool(), still)
    return 0 if met is None else max(1, int(np.ceil(met.time_s)))


def as_table(reach: dict[float, Row]) -> str:
    """Write the reach as a Markdown table in centimetres, a row for each height in metres."""
    pitches = list(next(iter(reach.values()), {}))
    lines = [["z", *(f"{pitch:g}" for pitch in pitches)], ["-"] * (len(pitches) + 1)]
    for height, row in reach.items():
        lines.append([f"{height:g}", *map(_cm, row.values())])
    return "\n".join(f"|{'|'.join(cells)}|" for cells in lines)


def _cm(span: Span | None) -> str:
    return f"{100 * span.least:.0f}-{100 * span.most:.0f}" if span else "none"

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
from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import Brief, JointTrajectory, Robot, RolloutSettings, Task
from core.robot.extents import fingers_of
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
_SIDES = ("to the front", "to the left", "up"), ("to the back", "to the right", "down")  # along x, y, z, and reversed
PITCHES = (-0.8, -0.5, 0.0, 0.5, 0.8)
_RISE_M = 0.1  # between two heights
_LARGE_RAD = 1.5
_LOW_M, _LARGE_AT_M = 0.1, 0.3  # heights of a low and near pose, and of those with large turns
_STEP_M, _STEP_RAD = 0.02, 0.1
_NEAR_M, _NEAR_RAD = 0.003, 0.02  # a pose missed by less counts as reached


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
    turned: str  # how far it reaches with large turns
    turns: str  # how far it turns by roll, pitch and yaw at home, and with which torque
    low: str  # a sentence: what space the links around the mount take in a low and near pose; or empty
    joints: str  # their values at home
    speed: str  # a sentence
    exactness: str  # sentences; empty if it was not measured
    around: str  # a table of the links around the mount at home, in its frame
    clear: bool  # whether all of these but the gripper are above the mount
    bearers: tuple[str, ...]  # the links among these that a rigid tool may overlap
    fingers: tuple[FingerSheet, ...]


def told(brief: Brief, mounted: Tool, rollout: RolloutSettings, engine: str) -> ArmSheet:
    """Describe the arm for templates: their ``arm``."""
    return describe_arm(brief.task, rollout, engine, brief.gripper)


def describe_arm(task: Task, rollout: RolloutSettings, engine: str, gripper: bool) -> ArmSheet:
    """Describe the arm at the task's home, in the engine of this name, with its gripper or without.

    Raises:
        UserError: the arm can't reach the task's home.
    """
    return _sheet(task.robot, task.home, rollout, engine, gripper)


@lru_cache(maxsize=16)
def _sheet(robot: Robot, home: Pose, rollout: RolloutSettings, engine: str, gripper: bool) -> ArmSheet:
    arm = arm_of(robot)
    joints = arm.home_for(home)
    reach = compute_reach(arm)
    turns = zip(("roll", "pitch", "yaw"), turns_at(arm, home), strict=True)
    around = extents_at_home(robot, gripper, home)
    shaped, own = extents_at_home(robot, False, home), robot.base.rpy[2]
    return ArmSheet(
        at=short_numbers(robot.base.position, 4, ", ") if robot.base != Pose() else "",
        yaw=short_number(own, 4) if own else "",
        reach=as_table({z: row for z, row in reach.items() if z <= _EACH_M or round(10 * z) % 2 == 0}),
        turned=describe_turned(arm),
        turns=", ".join(f"{name} {_turn(*least_most)}" for name, least_most in turns)
        + f", with {moment_limit(robot):g} N m",
        low=describe_low(arm, reach, shaped),
        joints=short_numbers(joints, 2, ", "),
        speed=describe_speed(segments(arm, home, rollout)),
        exactness=describe_exactness(robot.measured, engine),
        around=table(
            ("link", "x", "y", "z"),
            [(name, *(_range(*ends) for ends in zip(*extent, strict=True))) for name, extent in around.items()],
        ),
        clear=all(low[2] > -_LEVEL_M for low, _ in shaped.values()),
        bearers=tuple(name for name in robot.near_mount if name in shaped),
        fingers=tuple(
            FingerSheet(
                finger.name,
                short_numbers(finger.pose.position, 4, ", "),
                tuple(_side(axis) for axis in finger.pose.rotation.as_matrix().T),
                short_number(-finger.place(finger.tip)[2], 3),
            )
            for finger in fingers_of(robot)
        ),
    )


def _range(low: float, high: float) -> str:
    return f"{short_number(low, 3)} to {short_number(high, 3)}"


def _side(way: Array) -> str:
    """Say where an axis (3,) points in the frame of the tool mount."""
    axis = int(np.abs(way).argmax())
    aligned = abs(way[axis]) > 1 - 1e-4  # within a degree
    return _SIDES[int(way[axis] < 0)][axis] if aligned else f"along ({short_numbers(way, 3, ', ')})"


def _turn(least: float, most: float) -> str:
    return "at will" if min(-least, most) > _AT_WILL_RAD else f"{least:.1f} to {most:.1f}"


def segments(arm: Arm, home: Pose, rollout: RolloutSettings) -> list[Segment]:
    """Time straight segments around home."""
    found = []
    for axis, way in zip(np.eye(3), WAYS, strict=True):
        for length in LENGTHS_M:
            ends = [[*(home.position + side * length / 2 * axis), *home.rpy] for side in (-1, 1)]
            motion = plan_motion(np.array(ends), home, arm, segment_s=rollout.segment_s, speed=rollout.speed)
            first, last = motion.arrivals.tolist()
            joints, _ = motion.trajectory.sample(np.linspace(first, last, _SAMPLES))
            steps = np.linalg.norm(np.diff(arm.positions(joints), axis=0), axis=1)
            found.append(Segment(way, length, last - first, float(steps.max() / steps.mean())))
    return found


def describe_speed(segments: Sequence[Segment]) -> str:
    """Say how long segments take, and how much faster than on average they are at most."""
    by_length = [[one for one in segments if one.length == length] for length in (LENGTHS_M[0], LENGTHS_M[-1])]
    times = [f"{'/'.join(f'{one.seconds:.2g}' for one in group)} s for {group[0].length:g} m" for group in by_length]
    peaks = min(one.peak for one in segments), max(one.peak for one in segments)
    return (
        f"Segments {'/'.join(WAYS)} through home take {', '.join(times)}, with a peak speed of {peaks[0]:.2g} to "
        f"{peaks[1]:.2g} times the mean"
    )


def short(figure: float) -> str:
    """Write a figure with two digits, and no fewer before the point."""
    return f"{figure:.2g}" if abs(figure) < 99.5 else f"{figure:.0f}"


def describe_exactness(measured: Mapping[str, Mapping[str, float | None]], engine: str) -> str:
    """Say how exact the arm is in this engine, or where it was not measured, over all in which it was."""
    figures = [measured[engine]] if engine in measured else list(measured.values())
    if not figures:
        return ""

    def over(name: str, digits: int = 2) -> str:
        numbers = [round(figure, digits) for one in figures if (figure := one[name]) is not None]
        return " to ".join(dict.fromkeys(short(bound(numbers)) for bound in (min, max))) if numbers else ""

    where = engine if engine in measured else f"{len(figures)} engines"
    force = [f"{push} N per mm"] if (push := over("push_n_per_mm")) else []
    force += ["full force at once"] if any(one["push_n_per_mm"] is None for one in figures) else []
    turn = [f"{figure} N m per rad" for figure in over("turn_nm_per_rad", 0).split(" to ") if figure]
    turn += ["full torque at once"] if any(one["turn_nm_per_rad"] is None for one in figures) else []
    most = max(figure for one in figures if (figure := one["most_n"]) is not None)
    return (
        f"Measured in {where}: in motion it lags by up to {over('lag_mm')} mm, with 1 kg mounted by "
        f"{over('lag_mm_1kg')} mm; at rest it misses by {over('rest_mm')} "
        f"mm, under a load of 1 kg by {over('sag_mm_1kg')} mm. Held back, it presses with {' or '.join(force)}, "
        f"{most:.0f} N at most; turned back, it turns with {' or '.join(turn)}. Sent 2 mm into the table and 0.1 m "
        f"along it, it ends {over('slid_miss_mm')} mm behind"
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


def span_at(arm: Arm, height: float, pitch: float, roll: float = 0.0) -> Span | None:
    """Find the distances that are reached at this height and turn: out from near home's, and back in from there."""
    x, y, _ = arm.robot.base.position
    base = Pose.xyz_rpy((x, y, 0.0), (0.0, 0.0, arm.robot.base.rpy[2]))
    farthest = int(robot_model(arm.robot, Tool()).reach / _STEP_M)
    home = round(float(np.hypot(*base.inverse().apply(arm.forward(arm.home).position)[:2])) / _STEP_M)
    turn = Rotation.from_euler("xy", (roll, pitch))
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


def describe_turned(arm: Arm) -> str:
    """Say how far the arm reaches with large turns, as the table of the reach does."""
    found = []
    for angle in (-_LARGE_RAD, _LARGE_RAD):
        rolled, pitched = (span_at(arm, _LARGE_AT_M, pitch, roll) for pitch, roll in ((0.0, angle), (angle, 0.0)))
        found += [f"roll {angle:g}: {_cm(rolled)}", f"pitch {angle:g}: {_cm(pitched)}"]
    return f"at z {_LARGE_AT_M:g} with {', '.join(sorted(found))}"


def describe_low(arm: Arm, reach: dict[float, Row], links: Iterable[str]) -> str:
    """Say what space these links take where the arm is low and nearly as near as it goes; empty if it can't be."""
    span = reach.get(_LOW_M, {}).get(0.0)
    if span is None:
        return ""
    ahead, (x, y, _) = span.least + 2 * _STEP_M, arm.robot.base.position
    pose = Pose.xyz_rpy((x, y, _LOW_M), (0.0, 0.0, arm.robot.base.rpy[2])) @ Pose(np.array([ahead, 0.0, 0.0]))
    try:
        extents = extents_at_home(arm.robot, False, pose)
    except UserError:  # reached along the way from home alone
        return ""
    low, high = zip(*(extents[link] for link in links if link in extents), strict=True)
    ends = zip("xyz", np.min(low, axis=0), np.max(high, axis=0), strict=True)
    box = ", ".join(f"{axis} {_range(*pair)}" for axis, *pair in ends)
    return f"At z {_LOW_M:g}, {100 * ahead:.0f} cm ahead, the links of the table below take up {box}"


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
        lines.append([f"{height:g}", *map(_cm, row.values())])
    return "\n".join(f"|{'|'.join(cells)}|" for cells in lines)


def _cm(span: Span | None) -> str:
    return f"{100 * span.least:.0f}-{100 * span.most:.0f}" if span else "none"

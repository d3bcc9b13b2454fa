"""Say in a prompt where the arm stands and reaches, how fast and exact it is, and what a tool meets at the mount."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from core.designs.reach import as_table, compute_reach, turns_at
from core.geometry import Array, Pose
from core.interfaces import Robot, RolloutSettings, Task
from core.robot.extents import extents_at_home, fingers_of
from core.robot.kinematics import Arm, arm_of
from core.robot.trajectory import plan_motion
from core.support.text import short_number, short_numbers, table

WAYS = ("forward", "left", "up")
LENGTHS_M = (0.1, 0.2, 0.4)
_EACH_M = 0.6  # up to here each height is shown, above it every other
_AT_WILL_RAD = 2.8  # nearly half a turn to both sides
_SAMPLES = 400
_LEVEL_M = 0.001
_SIDES = ("to the front", "to the left", "up"), ("to the back", "to the right", "down")  # along x, y, z, and reversed


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
    turns: str  # how far it turns by roll, pitch and yaw at home
    joints: str  # their values at home
    speed: str  # a sentence
    exactness: str  # sentences; empty if it was not measured
    around: str  # a table of the links around the mount at home, in its frame
    clear: bool  # whether all of these but the gripper are above the mount
    bearers: tuple[str, ...]  # the links among these that a rigid tool may overlap
    fingers: tuple[FingerSheet, ...]


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
        turns=", ".join(f"{name} {_turn(*least_most)}" for name, least_most in turns),
        joints=short_numbers(joints, 2, ", "),
        speed=describe_speed(robot, segments(arm, home, rollout)),
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


def describe_speed(robot: Robot, segments: Sequence[Segment]) -> str:
    """Say how long segments take, and how much faster than on average they are at most."""
    by_length = [[one for one in segments if one.length == length] for length in (LENGTHS_M[0], LENGTHS_M[-1])]
    times = [f"{'/'.join(f'{one.seconds:.2g}' for one in group)} s for {group[0].length:g} m" for group in by_length]
    peaks = min(one.peak for one in segments), max(one.peak for one in segments)
    limits = [f"{limit:g}" for limit in robot.acceleration_limits]
    most = limits[0] if len(set(limits)) == 1 else ", ".join(limits)
    return (
        f"Segments {'/'.join(WAYS)} through home take {', '.join(times)}, with a peak speed of {peaks[0]:.2g} to "
        f"{peaks[1]:.2g} times the mean. Joints accelerate by at most {most} rad/s2, half of it for bends of the path"
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
    most = max(figure for one in figures if (figure := one["most_n"]) is not None)
    return (
        f"Measured in {where}: in motion it lags by up to {over('lag_mm')} mm, with 1 kg mounted by "
        f"{over('lag_mm_1kg')} mm ({over('lag_rad_1kg', 4)} rad at a joint); at rest it misses by {over('rest_mm')} "
        f"mm, under a load of 1 kg by {over('sag_mm_1kg')} mm. Held back, it presses with {' or '.join(force)}, "
        f"{most:.0f} N at most; sent 2 mm into the table and 0.1 m along it, it ends {over('slid_miss_mm')} mm behind"
    )

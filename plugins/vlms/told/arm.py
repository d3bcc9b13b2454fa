"""Say in a prompt where the arm stands and reaches, how fast and exact it is, and what a tool meets at the mount."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from core.design import Tool
from core.designs.prompt_values import RunFacts
from core.designs.statics import moment_limit
from core.geometry import Array, Pose
from core.interfaces import Brief, Robot, RolloutSettings, Task, Waypoints
from core.robot.extents import Finger, fingers_of
from core.robot.kinematics import Arm, arm_of
from core.robot.trajectory import plan_motion
from core.support.text import short_number, short_numbers
from plugins.vlms.told.outline import extents_at_home
from plugins.vlms.told.reach import as_table, compute_reach, turns_at
from plugins.vlms.told.tables import table

DIRECTIONS = ("forward", "left", "up")
LENGTHS_M = (0.1, 0.2, 0.4)
_EACH_M = 0.6  # up to here each height is shown, above it every other
_AT_WILL_RAD = 2.8  # nearly half a turn to both sides
_SAMPLES = 400
_LEVEL_M = 0.001
_ALIGNED = 1 - 1e-4  # within a degree
_POSITIVE = ("to the front", "to the left", "up")  # along x, y, z
_NEGATIVE = ("to the back", "to the right", "down")


@dataclass(frozen=True)
class Segment:
    """A straight way through home.

    Attributes:
        direction: of `DIRECTIONS`.
        length: metres.
        seconds: how long it takes.
        peak: the ratio of its peak speed to its mean.
    """

    direction: str
    length: float
    seconds: float
    peak: float


@dataclass(frozen=True)
class FingerSheet:
    """A finger of the open gripper, as the tool mount has it.

    Attributes:
        name: of its link.
        origin: of its frame.
        axes: where its x, y and z point.
        below: how far below the mount it ends, metres.
    """

    name: str
    origin: str
    axes: tuple[str, ...]
    below: str


@dataclass(frozen=True)
class ArmSheet:
    """The arm's facts for templates.

    Attributes:
        at: where its base stands, x, y and z; empty at the world's origin.
        yaw: how the base is turned; empty if it is not.
        reach: a table.
        turns: how far it turns by roll, pitch and yaw at home, and with which torque.
        joints: their values at home.
        speed: a sentence.
        exactness: sentences; empty if it was not measured.
        around: a table of the links around the mount at home, in its frame.
        clear: whether all of these but the gripper are above the mount.
        bearers: the links among these that a rigid tool may overlap.
        fingers: of the gripper.
    """

    at: str
    yaw: str
    reach: str
    turns: str
    joints: str
    speed: str
    exactness: str
    around: str
    clear: bool
    bearers: tuple[str, ...]
    fingers: tuple[FingerSheet, ...]


def arm_value(brief: Brief, mounted: Tool, facts: RunFacts) -> ArmSheet:
    """Describe the arm for templates: their ``arm``."""
    return describe_arm(brief.task, facts.rollout, facts.engine, brief.gripper)


def describe_arm(
    task: Task,
    rollout: RolloutSettings,
    engine: str,
    gripper: bool,
) -> ArmSheet:
    """Describe the arm at the task's home, in the engine of this name, with its gripper or without.

    Args:
        task: whose robot and home it is about.
        rollout: how fast plans are carried out.
        engine: by which the arm's exactness was measured.
        gripper: whether the tool is one for the gripper's fingers.

    Raises:
        UserError: the arm can't reach the task's home.
    """
    return _describe(task.robot, task.home, rollout, engine, gripper)


@lru_cache(maxsize=16)
def _describe(
    robot: Robot,
    home: Pose,
    rollout: RolloutSettings,
    engine: str,
    gripper: bool,
) -> ArmSheet:
    """Measure what a sheet says, once for each robot and home."""
    arm = arm_of(robot)
    base = robot.base
    yaw = base.rpy[2]
    bare = extents_at_home(robot, False, home)
    return ArmSheet(
        at=short_numbers(base.position, 4, ", ") if base != Pose() else "",
        yaw=short_number(yaw, 4) if yaw else "",
        reach=_describe_reach(arm),
        turns=f"{_describe_turns(arm, home)}, with {moment_limit(robot):g} N m",
        joints=short_numbers(arm.home_for(home), 2, ", "),
        speed=describe_speed(segments(arm, home, rollout)),
        exactness=describe_exactness(robot.measured, engine),
        around=_describe_links(robot, gripper, home),
        clear=all(low[2] > -_LEVEL_M for low, _ in bare.values()),
        bearers=tuple(name for name in robot.near_mount if name in bare),
        fingers=tuple(_describe_finger(finger) for finger in fingers_of(robot)),
    )


def _describe_reach(arm: Arm) -> str:
    """Write the reach as a table, of every other height where they are high."""
    shown = {}
    for z, row in compute_reach(arm).items():
        if z <= _EACH_M or round(10 * z) % 2 == 0:
            shown[z] = row
    return as_table(shown)


def _describe_turns(arm: Arm, home: Pose) -> str:
    """Say how far the end-effector turns at home.

    Args:
        arm: of the robot.
        home: pose of the end-effector.
    """
    texts = []
    names = ("roll", "pitch", "yaw")
    for name, (least, most) in zip(names, turns_at(arm, home), strict=True):
        if min(-least, most) > _AT_WILL_RAD:
            texts.append(f"{name} at will")
        else:
            texts.append(f"{name} {least:.1f} to {most:.1f}")

    return ", ".join(texts)


def _describe_links(robot: Robot, gripper: bool, home: Pose) -> str:
    """Write a table of the links around the mount at home, in its frame.

    Args:
        robot: of which links are shown.
        gripper: whether it has its gripper.
        home: pose of the end-effector.
    """
    rows = []
    for name, (lows, highs) in extents_at_home(robot, gripper, home).items():
        cells = [name]
        for low, high in zip(lows, highs, strict=True):
            cells.append(f"{short_number(low, 3)} to {short_number(high, 3)}")
        rows.append(tuple(cells))

    return table(("link", "x", "y", "z"), rows)


def _describe_finger(finger: Finger) -> FingerSheet:
    """Describe a finger for templates."""
    origin = short_numbers(finger.pose.position, 4, ", ")
    axes = [_describe_axis(axis) for axis in finger.pose.rotation.as_matrix().T]
    depth = -finger.place(finger.tip)[2]
    return FingerSheet(finger.name, origin, tuple(axes), short_number(depth, 3))


def _describe_axis(axis: Array) -> str:
    """Say where an axis (3,) points in the frame of the tool mount."""
    number = int(np.abs(axis).argmax())
    if axis[number] > _ALIGNED:
        return _POSITIVE[number]
    if axis[number] < -_ALIGNED:
        return _NEGATIVE[number]
    return f"along ({short_numbers(axis, 3, ', ')})"


def segments(arm: Arm, home: Pose, rollout: RolloutSettings) -> list[Segment]:
    """Time straight segments around home.

    Args:
        arm: of the robot.
        home: pose of the end-effector in the middle of each segment.
        rollout: see `_time`.
    """
    timed = []
    for axis, direction in zip(np.eye(3), DIRECTIONS, strict=True):
        for length in LENGTHS_M:
            half = length / 2 * axis
            seconds, peak = _time(arm, home, half, rollout)
            timed.append(Segment(direction, length, seconds, peak))

    return timed


def _time(
    arm: Arm,
    home: Pose,
    half: Array,
    rollout: RolloutSettings,
) -> tuple[float, float]:
    """Time the straight way through home from ``-half`` to ``half`` (3,).

    Args:
        arm: of the robot.
        home: pose of the end-effector, which keeps its turn.
        half: half of the way, metres.
        rollout: which has the least duration of a segment, and the speed.

    Returns:
        Seconds, and the ratio of the peak speed to the mean.
    """
    ends = np.array(
        [[*(home.position - half), *home.rpy], [*(home.position + half), *home.rpy]]
    )
    motion = plan_motion(
        Waypoints(ends),
        home,
        arm,
        segment_s=rollout.segment_s,
        speed=rollout.speed,
    )
    first, last = motion.arrivals.tolist()
    joints, _ = motion.trajectory.sample(np.linspace(first, last, _SAMPLES))
    steps = np.linalg.norm(np.diff(arm.positions(joints), axis=0), axis=1)

    return last - first, float(steps.max() / steps.mean())


def describe_speed(segments: Sequence[Segment]) -> str:
    """Say how long segments take, and how much faster than on average they are at most."""
    times = []
    for length in (LENGTHS_M[0], LENGTHS_M[-1]):
        same = [segment for segment in segments if segment.length == length]
        seconds = "/".join(f"{segment.seconds:.2g}" for segment in same)
        times.append(f"{seconds} s for {length:g} m")

    peaks = [segment.peak for segment in segments]
    return (
        f"Segments {'/'.join(DIRECTIONS)} through home take {', '.join(times)}, with a peak speed of "
        f"{min(peaks):.2g} to {max(peaks):.2g} times the mean"
    )


def short(figure: float) -> str:
    """Write a figure with two digits, and no fewer before the point."""
    return f"{figure:.2g}" if abs(figure) < 99.5 else f"{figure:.0f}"


def describe_exactness(
    measured: Mapping[str, Mapping[str, float | None]],
    engine: str,
) -> str:
    """Say how exact the arm is in this engine; empty where it was not measured.

    Args:
        measured: figures by engine.
        engine: its name.
    """
    if engine not in measured:
        return ""

    figures = {}
    for name, figure in measured[engine].items():
        if figure is not None:
            figures[name] = short(figure)

    force = "full force at once"
    if "push_n_per_mm" in figures:
        force = f"{figures['push_n_per_mm']} N per mm"

    turn = measured[engine]["turn_nm_per_rad"]
    torque = "full torque at once" if turn is None else f"{turn:.0f} N m per rad"
    return (
        f"Measured in {engine}: in motion it lags by up to {figures['lag_mm']} mm, with 1 kg mounted by "
        f"{figures['lag_mm_1kg']} mm; at rest it misses by {figures['rest_mm']} mm, under a load of 1 kg by "
        f"{figures['sag_mm_1kg']} mm. Held back, it presses with {force}, {figures['most_n']} N at most; turned "
        f"back, it turns with {torque}. Sent 2 mm into the table and 0.1 m along it, it ends "
        f"{figures['slid_miss_mm']} mm behind"
    )

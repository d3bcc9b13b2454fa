"""Say in a prompt where the arm stands and reaches, how fast and exact it is, and what a tool meets at the mount."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from core.design import Tool
from core.designs.prompt_values import RunFacts
from core.designs.statics import moment_limit
from core.geometry import Array, Pose, step_lengths
from core.interfaces import Brief, Robot, RolloutSettings, Waypoints
from core.robot.extents import Finger, fingers_of
from core.robot.kinematics import Arm, arm_of
from core.robot.trajectory import plan_motion
from core.support.text import short_number, short_numbers
from plugins.vlms.context.outline import extents_at_home
from plugins.vlms.context.phrases import phrase, table
from plugins.vlms.context.reach import compute_reach, turns_at

DIRECTIONS = ("forward", "left", "up")
LENGTHS_M = (0.1, 0.2, 0.4)
_EACH_M = 0.6  # up to here each height is shown, above it every other
_SAMPLES = 400
_LEVEL_M = 0.001


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
        fingers: a line for each finger of the open gripper, as the tool mount has it.
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
    fingers: tuple[str, ...]


def arm_value(brief: Brief, mounted: Tool, facts: RunFacts) -> ArmSheet:
    """Describe the arm for templates: their ``arm``."""
    task = brief.task
    return describe_arm(
        task.robot, task.home, facts.rollout, facts.engine, brief.gripper
    )


@lru_cache(maxsize=16)
def describe_arm(
    robot: Robot,
    home: Pose,
    rollout: RolloutSettings,
    engine: str,
    gripper: bool,
) -> ArmSheet:
    """Describe an arm at a task's home, in the engine of this name, with its gripper or without.

    What is measured for it takes seconds; it is kept.

    Args:
        robot: with its base where it stands.
        home: pose of the end-effector.
        rollout: how fast plans are carried out.
        engine: by which the arm's exactness was measured.
        gripper: whether the tool is one for the gripper's fingers.

    Raises:
        UserError: the arm can't reach ``home``.
    """
    arm = arm_of(robot)
    base = robot.base
    yaw = base.rpy[2]
    bare = extents_at_home(robot, False, home)

    # Of every other height where they are high.
    reach = {}
    for z, row in compute_reach(arm).items():
        if z <= _EACH_M or round(10 * z) % 2 == 0:
            reach[z] = row

    turns = dict(zip(("roll", "pitch", "yaw"), turns_at(arm, home), strict=True))
    exactness = ""
    if engine in robot.measured:
        exactness = phrase("arm", "exactness", robot.measured[engine], engine)

    return ArmSheet(
        at=short_numbers(base.position, 4, ", ") if base != Pose() else "",
        yaw=short_number(yaw, 4) if yaw else "",
        reach=phrase("arm", "reach", reach),
        turns=f"{phrase('arm', 'turning', turns)}, with {moment_limit(robot):g} N m",
        joints=short_numbers(arm.home_for(home), 2, ", "),
        speed=phrase("arm", "speed", segments(arm, home, rollout)),
        exactness=exactness,
        around=_describe_links(robot, gripper, home),
        clear=all(low[2] > -_LEVEL_M for low, _ in bare.values()),
        bearers=tuple(name for name in robot.near_mount if name in bare),
        fingers=tuple(_describe_finger(finger) for finger in fingers_of(robot)),
    )


def _describe_links(robot: Robot, gripper: bool, home: Pose) -> str:
    """Write a table of the links around the mount at home, in its frame.

    Args:
        robot: of which links are shown.
        gripper: whether it has its gripper.
        home: pose of the end-effector.
    """
    rows = []
    for name, extent in extents_at_home(robot, gripper, home).items():
        spans = [short_numbers(span, 3, " to ") for span in zip(*extent, strict=True)]
        rows.append((name, *spans))

    return table(("link", "x", "y", "z"), rows)


def _describe_finger(finger: Finger) -> str:
    """Describe a finger for templates."""
    axes = finger.pose.rotation_matrix.T.tolist()
    depth = -finger.place(finger.tip)[2]
    return phrase("arm", "finger", finger, axes, depth, short_numbers)


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
    places = (home.position - half, home.position + half)
    ends = np.array([[*place, *home.rpy] for place in places])
    motion = plan_motion(
        Waypoints(ends),
        home,
        arm,
        segment_s=rollout.segment_s,
        speed=rollout.speed,
    )
    first, last = motion.arrivals.tolist()
    joints, _ = motion.trajectory.sample(np.linspace(first, last, _SAMPLES))
    steps = step_lengths(arm.positions(joints))

    return last - first, float(steps.max() / steps.mean())

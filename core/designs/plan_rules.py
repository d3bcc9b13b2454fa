"""Rules for action plans of every representation: numbers, lengths, times, and the work of playing them."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import DesignError, Tool
from core.designs.rules import Faults
from core.geometry import Array, Pose, step_lengths
from core.interfaces import JointTrajectory, RolloutSettings, Task, Waypoints
from core.robot.paths import KNOT_M, KNOT_RAD
from core.scene import Scene
from core.solids.record_rate import sample_hz
from core.support.text import kind
from core.values.refusals import DesignReason

MAX_WAYPOINTS = 200
"""The most waypoints of a plan."""

MAX_REACH_M = 3.0
"""How far a waypoint may be from the world's origin."""

MAX_ANGLE_RAD = 6.3
"""The largest roll, pitch or yaw of a waypoint: a full turn, however it is rounded. More was meant in degrees."""

MIN_TEMPO = 0.001
"""The least speed or time that a plan may ask for, m/s or s."""

MAX_POSES = 2_000_000
"""The most poses that are computed for a candidate: of its way, and of its tool in motion."""

KNOT_POSES = 1000
"""What inverse kinematics at a knot of the way costs, in poses."""

MAX_KNOTS = MAX_POSES // KNOT_POSES
"""The most knots of a way."""

WAYPOINT = ("x", "y", "z", "roll", "pitch", "yaw", "gripper")
"""The numbers of a waypoint; the last one is for tools with the gripper."""

_ROUNDED_RAD = 0.01  # half a turn is written as 3.14 or 3.15, too
_METRES = (-MAX_REACH_M, MAX_REACH_M, "metres")
_RADIANS = (-MAX_ANGLE_RAD, MAX_ANGLE_RAD, "radians (90 degrees are 1.5708)")
_GRIP = (0.0, 1.0, "(0 is open, 1 is closed)")
_RANGES = (*[_METRES] * 3, *[_RADIANS] * 3, _GRIP)  # of the numbers of `WAYPOINT`


def check_plan(plan: object, *, gripper: bool) -> Array:
    """Check an action plan; return it as an array, (N, 6) or with the gripper (N, 7): see `core.design.Candidate`.

    Args:
        plan: an array, or lists of numbers from JSON.
        gripper: whether waypoints have the gripper's number.

    Raises:
        DesignError: names the wrong waypoints (from 1) and their faults.
    """
    if isinstance(plan, np.ndarray):
        plan = plan.tolist()

    if not isinstance(plan, list | tuple):
        raise DesignError.because(DesignReason.PLAN_LIST, given=kind(plan))

    if not 1 <= len(plan) <= MAX_WAYPOINTS:
        raise DesignError.because(
            DesignReason.PLAN_COUNT, count=len(plan), least=1, most=MAX_WAYPOINTS
        )

    faults = Faults()
    for number, waypoint in enumerate(plan, start=1):
        with faults.collect():
            check_waypoint(waypoint, f"waypoint {number}", gripper)
    faults.refuse()

    poses = np.array(plan, float)
    if len(poses) > 1:
        _check_length(poses)

    return poses


def check_waypoint(waypoint: object, where: str, gripper: bool) -> None:
    """Refuse what is not a list of numbers, each within its range; ``where`` names the waypoint."""
    names = WAYPOINT if gripper else WAYPOINT[:6]

    if not isinstance(waypoint, list | tuple):
        raise DesignError.because(
            DesignReason.WAYPOINT_LIST,
            where=where,
            needed=len(names),
            given=kind(waypoint),
        )

    if len(waypoint) != len(names):
        raise DesignError.because(
            DesignReason.WAYPOINT_COUNT,
            where=where,
            count=len(waypoint),
            needed=len(names),
            names=", ".join(names),
        )

    faults = Faults()
    for name, number, limits in zip(names, waypoint, _RANGES, strict=False):
        least, most, unit = limits
        if isinstance(number, bool) or not isinstance(number, int | float):
            faults.add(
                DesignReason.WAYPOINT_NUMBER, where=where, name=name, given=kind(number)
            )
        # Refuses nan, and integers that are too large for a float, too.
        elif not least <= number <= most:
            faults.add(
                DesignReason.WAYPOINT_RANGE,
                where=where,
                name=name,
                given=number,
                least=least,
                most=most,
                unit=unit,
            )
    faults.refuse()

    away = math.hypot(*waypoint[:3])
    if away > MAX_REACH_M:
        raise DesignError.because(
            DesignReason.WAYPOINT_FAR, where=where, away_m=away, most_m=MAX_REACH_M
        )


def _check_length(poses: Array) -> None:
    """Refuse a way through poses (N, 6 or 7) whose inverse kinematics would take too long."""
    turns = Rotation.from_euler("xyz", poses[:, 3:6])
    metres = step_lengths(poses[:, :3])
    radians = (turns[:-1].inv() * turns[1:]).magnitude()
    knots = np.ceil(np.maximum(metres / KNOT_M, radians / KNOT_RAD))

    if knots.sum() > MAX_KNOTS:
        raise DesignError.because(
            DesignReason.WAY_LENGTH,
            way_m=metres.sum(),
            turn_rad=radians.sum(),
            steps=int(knots.sum()),
            most=MAX_KNOTS,
            step_m=KNOT_M,
            step_rad=KNOT_RAD,
        )


def find_turn_warnings(turns: Array) -> Iterator[str]:
    """Say where angles may have been meant in degrees: the first turn of more than half a turn to a waypoint.

    Args:
        turns: (N, 3) roll, pitch and yaw of waypoints as they are written, radians. What is within half a turn of 0, on
            both sides, is a turn across the end of the range.
    """
    before = np.vstack([np.zeros((1, 3)), turns[:-1]])[: len(turns)]
    is_wide = np.abs(turns - before) > math.pi
    is_beyond = np.maximum(np.abs(turns), np.abs(before)) > math.pi + _ROUNDED_RAD

    for number, axis in np.argwhere(is_wide & is_beyond)[:1].tolist():
        angle = turns[number, axis]
        turn = angle - before[number, axis]
        short = math.remainder(turn, math.tau)
        yield (
            f"waypoint {number + 1}: its {WAYPOINT[3 + axis]} of {angle:g} is read as radians, a turn of "
            f"{math.degrees(turn):.0f} degrees, for which the arm turns the short way, by {short:.3g} rad; if "
            f"{angle:g} degrees were meant, write {math.radians(angle):.4g}"
        )


def check_tempo(plan: Waypoints, home: Pose, most_s: float) -> None:
    """Refuse a plan that asks for next to no speed or time, or for too much time in all.

    Args:
        plan: with its tempo, if it says any.
        home: where the way begins.
        most_s: the most seconds in all.

    Raises:
        DesignError: names the wrong waypoint (from 1), or the time in all.
    """
    tempo = plan.tempo
    if tempo is None:
        return

    for name, asked in (("speed", tempo.speeds), ("time", tempo.seconds)):
        for k in np.flatnonzero(asked < MIN_TEMPO)[:1]:
            raise DesignError.because(
                DesignReason.TEMPO,
                waypoint=k + 1,
                name=name,
                given=asked[k],
                least=MIN_TEMPO,
            )

    places = np.vstack([home.position, plan.poses[:, :3]])
    metres = step_lengths(places)
    has_time = np.isfinite(tempo.seconds)
    asked = np.where(has_time, tempo.seconds, metres / tempo.speeds)
    seconds = float(np.nansum(asked) + tempo.waits.sum())

    if seconds > most_s:
        raise DesignError.because(DesignReason.PLAN_TIME, time_s=seconds, most_s=most_s)


def check_motion(
    task: Task,
    tool: Tool,
    scene: Scene,
    settings: RolloutSettings,
    trajectory: JointTrajectory,
    begins: float = 0.0,
) -> float:
    """Refuse a motion that would take too long to play and to look at; return how often it is looked at, Hz.

    Args:
        task: whose robot moves.
        tool: what moves.
        scene: the layout.
        settings: whether it is looked at, and how long it may take.
        trajectory: of the motion.
        begins: how many seconds of motion are before it.

    Raises:
        DesignError: with the figures.
    """
    seconds = begins + trajectory.duration
    most = settings.max_motion_s

    if seconds > most:
        raise DesignError.because(DesignReason.MOTION_TIME, time_s=seconds, most_s=most)

    if settings.penetration == "ignore" and not settings.observe:
        return 0.0

    hz = sample_hz(task.robot, tool, trajectory, scene)
    count = len(tool.parts)
    poses = count * seconds * hz

    if poses > MAX_POSES:
        raise DesignError.because(
            DesignReason.MOTION_POSES,
            count=count,
            rate_hz=hz,
            time_s=seconds,
            poses=poses,
            most=MAX_POSES,
        )

    return hz


def plan_limits() -> dict[str, float]:
    """Return the limits of a plan's length, as templates name them."""
    return {
        "max_waypoints": MAX_WAYPOINTS,
        "max_way_m": MAX_KNOTS * KNOT_M,
        "max_turn_rad": MAX_KNOTS * KNOT_RAD,
    }

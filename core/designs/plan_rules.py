"""Rules for action plans of every representation: numbers, lengths, times, and the work of playing them."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import DesignError, Tool
from core.geometry import Array, Pose
from core.interfaces import Waypoints
from core.robot.trajectory import KNOT_M, KNOT_RAD
from core.support.text import kind

MAX_WAYPOINTS = 200
MAX_REACH_M = 3.0
MIN_TEMPO = 0.001  # m/s or s, where a plan asks for a speed or a time
MAX_POSES = 2_000_000  # that are computed for a candidate, at most: of its way, and of its tool in motion
KNOT_POSES = 1000  # what inverse kinematics at a knot of the way costs
MAX_KNOTS = MAX_POSES // KNOT_POSES
MAX_ANGLE_RAD = 100.0
WAYPOINT = ("x", "y", "z", "roll", "pitch", "yaw", "gripper")


def check_plan(plan: object, *, gripper: bool) -> Array:
    """Check an action plan; return it as an array, (N, 6) or with the gripper (N, 7): see `core.design.Candidate`.

    ``plan`` is an array, or lists of numbers from JSON.

    Raises:
        DesignError: names the wrong waypoint (from 1) and its fault.
    """
    if isinstance(plan, np.ndarray):
        plan = plan.tolist()
    if not isinstance(plan, list | tuple):
        raise DesignError(
            f"an action plan must be a list of waypoints, not {kind(plan)}"
        )
    if not 1 <= len(plan) <= MAX_WAYPOINTS:
        raise DesignError(
            f"the action plan has {len(plan)} waypoints; between 1 and {MAX_WAYPOINTS} are needed"
        )
    names = WAYPOINT if gripper else WAYPOINT[:6]
    checked = np.array(
        [
            _check_waypoint(waypoint, f"waypoint {i}", names)
            for i, waypoint in enumerate(plan, start=1)
        ]
    )
    turns = Rotation.from_euler("xyz", checked[:, 3:6])
    ways = np.linalg.norm(np.diff(checked[:, :3], axis=0), axis=1)
    angles = (
        np.asarray((turns[:-1].inv() * turns[1:]).magnitude())
        if len(checked) > 1
        else ways
    )
    if np.ceil(np.maximum(ways / KNOT_M, angles / KNOT_RAD)).sum() > MAX_KNOTS:
        raise DesignError(
            f"the way through the waypoints is {ways.sum():.0f} m and {angles.sum():.0f} rad long; at most "
            f"{MAX_KNOTS * KNOT_M:g} m or {MAX_KNOTS * KNOT_RAD:g} rad are allowed"
        )
    return checked


def check_tempo(plan: Waypoints, home: Pose, most_s: float) -> None:
    """Refuse a plan that asks for next to no speed or time, or for more than ``most_s`` seconds in all.

    Raises:
        DesignError: names the wrong waypoint (from 1), or the time in all.
    """
    tempo = plan.tempo
    if tempo is None:
        return
    for name, asked in (("speed", tempo.speeds), ("time", tempo.seconds)):
        for k in np.flatnonzero(asked < MIN_TEMPO)[:1]:
            raise DesignError(
                f"waypoint {k + 1}: a {name} of {asked[k]:g} is too small; give {MIN_TEMPO:g} or more"
            )
    ways = np.linalg.norm(
        np.diff(np.vstack([home.position, plan.poses[:, :3]]), axis=0), axis=1
    )
    asked = np.where(np.isfinite(tempo.seconds), tempo.seconds, ways / tempo.speeds)
    if (seconds := float(np.nansum(asked) + tempo.waits.sum())) > most_s:
        raise DesignError(
            f"the plan asks for {seconds:.4g} s; at most {most_s:g} s are allowed"
        )


def check_work(tool: Tool, seconds: float, hz: float) -> None:
    """Refuse a motion that would take too long to play and to look at, at ``hz`` instants a second.

    Raises:
        DesignError: with the figures.
    """
    if (poses := len(tool.parts) * seconds * hz) > MAX_POSES:
        raise DesignError(
            f"the tool's {len(tool.parts)} parts would be looked at {hz:.0f} times a second for {seconds:.0f} s, which "
            f"is {poses:.2g} poses; at most {MAX_POSES:.2g} are computed: move slower, or use fewer and thicker parts"
        )


def _check_waypoint(
    waypoint: object, where: str, names: tuple[str, ...]
) -> list[float]:
    if not isinstance(waypoint, list | tuple):
        raise DesignError(
            f"{where} must be a list of {len(names)} numbers, not {kind(waypoint)}"
        )
    if len(waypoint) != len(names):
        raise DesignError(
            f"{where} has {len(waypoint)} numbers, {len(names)} are needed: {', '.join(names)}"
        )
    for name, number in zip(names, waypoint, strict=True):
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise DesignError(f"{where}: {name} must be a number, not {kind(number)}")
        if isinstance(number, float) and not math.isfinite(number):
            raise DesignError(f"{where}: {name} is {number}, a finite number is needed")
        # Also refuses integers that are too large for a float.
        limit, unit = (
            (MAX_ANGLE_RAD, "radians")
            if name in WAYPOINT[3:6]
            else (MAX_REACH_M, "metres")
        )
        if name != "gripper" and abs(number) > limit:
            raise DesignError(f"{where}: {name} is beyond {limit:g} {unit}")
        if name == "gripper" and not 0 <= number <= 1:
            raise DesignError(
                f"{where}: the gripper value must be between 0 (open) and 1 (closed)"
            )
    numbers = [float(number) for number in waypoint]
    reach = math.hypot(*numbers[:3])
    if reach > MAX_REACH_M:
        raise DesignError(
            f"{where} is {reach:.2f} m from the world's origin; at most {MAX_REACH_M:g} m are allowed"
        )
    return numbers


def plan_limits() -> dict[str, float]:
    """Return the limits of a plan's length, as templates name them."""
    return {
        "max_waypoints": MAX_WAYPOINTS,
        "max_way_m": MAX_KNOTS * KNOT_M,
        "max_turn_rad": MAX_KNOTS * KNOT_RAD,
    }

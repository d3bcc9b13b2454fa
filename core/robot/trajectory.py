"""Turn waypoints into a timed joint trajectory, once, before any engine is involved."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose, step_lengths
from core.interfaces import (
    Begin,
    JointTrajectory,
    Motion,
    RolloutSettings,
    Task,
    Tempo,
    Waypoints,
)
from core.robot.kinematics import Arm, arm_of
from core.robot.paths import APART_M, place_knots
from core.robot.timing import PEAK, Leg, time_leg


def plan_task_motion(
    plan: Waypoints,
    task: Task,
    settings: RolloutSettings,
    begin: Begin | None = None,
) -> Motion:
    """Plan the motion of the task's robot through waypoints, under a run's settings.

    Args:
        plan: N waypoints.
        task: has the robot, and the pose at which its end-effector starts.
        settings: have the times and the speed of `plan_motion`.
        begin: where the arm starts in place of the task's home.

    Raises:
        DesignError: see `plan_motion`.
    """
    return plan_motion(
        plan,
        task.home,
        arm_of(task.robot),
        begin,
        segment_s=settings.segment_s,
        speed=settings.speed,
    )


def plan_motion(
    plan: Waypoints,
    home: Pose,
    arm: Arm,
    begin: Begin | None = None,
    *,
    segment_s: float = 0.5,
    speed: float = 0.95,
) -> Motion:
    """Plan the motion through all waypoints.

    The arm rests at each, and in between the position moves on a straight line, the orientation by SLERP and the
    fingers linearly. A way lasts ``segment_s``, or longer if a joint would exceed its velocity or acceleration limit
    (times ``speed``). A tempo may ask for other times, for waits, and for waypoints that are passed without a stop.

    Args:
        plan: N waypoints.
        home: where the end-effector starts, at rest, with the gripper open.
        arm: gives kinematics and limits.
        begin: how the arm starts in place of ``home``.
        segment_s: the shortest time of a way that asks for none, seconds.
        speed: the share of the velocity and acceleration limits to use, 0..1.

    Raises:
        DesignError: no tempo keeps the arm's limits.
    """
    tempo = plan.tempo or Tempo.usual(len(plan))
    if begin is None:
        begin = Begin(arm.home_for(home))
    else:
        home = arm.forward(begin.joints)

    positions = np.vstack([home.position, plan.poses[:, :3]])
    turns = Rotation.from_euler("xyz", plan.poses[:, 3:6])
    rotations = Rotation.concatenate([home.rotation, turns])
    grips = np.clip([begin.grip, *plan.grips], 0.0, 1.0)
    stops = [0, *(np.flatnonzero(tempo.through[:-1] == 0) + 1).tolist(), len(plan)]

    path = place_knots(positions, rotations, stops)
    solved, errors = arm.follow(
        path.positions[1:], path.rotations[1:], begin.joints, arm.jump_rad
    )
    knots = np.vstack([begin.joints, solved])

    wanted = _ask_seconds(tempo, positions)
    asked = np.where(np.isfinite(wanted), wanted, segment_s)
    hurried = np.isfinite(tempo.seconds) | np.isfinite(tempo.speeds)

    legs = []
    for first, last in pairwise(stops):
        ends = path.ends[first : last + 1]
        leg = Leg(
            knots=knots[ends[0] : ends[-1] + 1],
            ends=[end - ends[0] for end in ends],
            grips=grips[first : last + 1],
            asked=asked[first:last],
            seconds=tempo.seconds[first:last],
            hurried=bool(hurried[first]),
            wait_s=tempo.waits[last - 1],
        )
        legs.append(leg)

    trajectory, reached = _join_legs(legs, arm, speed, plan.closes)
    steps = step_lengths(arm.positions(knots))

    # Errors before the first waypoint do no harm.
    counted = [path.ends[1] - 1, *path.ends[1:-1]]
    return Motion(
        trajectory,
        float(steps.sum()),
        reached,
        np.maximum.reduceat(errors, counted, axis=0),
        plan.poses,
        _compare_with_asked(reached, wanted, tempo.waits),
    )


def at_home(task: Task) -> JointTrajectory:
    """Make a trajectory without motion: the arm at the task's home pose, the fingers open."""
    joints = arm_of(task.robot).home_for(task.home)
    return JointTrajectory(np.zeros(1), joints[None], np.array([task.robot.opening_m]))


def _ask_seconds(tempo: Tempo, positions: Array) -> Array:
    """Compute the time that each way is asked to take, if it begins and ends at rest.

    A speed is that of the middle of the way, of which a fifth of the time is for each of acceleration and braking. It
    asks for nothing where the position does not move.

    Args:
        tempo: asks for seconds or for speeds.
        positions: (N + 1, 3) metres.

    Returns:
        Seconds (N,); nan: nothing is asked.
    """
    ways = step_lengths(positions)
    by_speed = np.where(ways > APART_M, PEAK * ways / tempo.speeds, np.nan)

    return np.where(np.isfinite(tempo.seconds), tempo.seconds, by_speed)


def _join_legs(
    legs: Sequence[Leg], arm: Arm, speed: float, closes: bool
) -> tuple[JointTrajectory, Array]:
    """Time legs, and join them to a trajectory.

    Args:
        legs: one after the other, of N waypoints in all.
        arm: gives the limits.
        speed: the share of them to use.
        closes: whether the waypoints say so of fingers, or of what a pump's switch stands for.

    Returns:
        The trajectory, and when each waypoint is reached (N,), seconds.
    """
    opening = arm.robot.opening_m or float(closes)
    begun = 0.0
    times = [np.zeros(1)]
    joints = [legs[0].knots[:1]]
    closed = [legs[0].grips[:1]]
    reached = list[float]()

    for leg in legs:
        timed = time_leg(leg, arm, speed)
        reached += [begun + seconds for seconds in timed.reached]
        times.append(begun + timed.times)
        joints.append(np.minimum(np.maximum(timed.joints, arm.lower), arm.upper))
        closed.append(_close_fingers(leg.grips, timed.times, timed.reached))
        begun = float(times[-1][-1])

        if leg.wait_s > 0:
            begun += leg.wait_s
            times.append(np.array([begun]))
            joints.append(joints[-1][-1:])
            closed.append(closed[-1][-1:])

    trajectory = JointTrajectory(
        np.concatenate(times),
        np.concatenate(joints),
        opening * (1 - np.concatenate(closed)),
    )
    return trajectory, np.array(reached)


def _close_fingers(grips: Array, times: Array, reached: list[float]) -> Array:
    """Interpolate how far the gripper is closed on a leg: linearly from each of its grips to the next.

    Args:
        grips: (N + 1,) at the leg's begin, and at each of its waypoints.
        times: (S,) seconds since it began.
        reached: (N,) when the waypoints are reached.

    Returns:
        Shares (S,), 0 to 1.
    """
    if len(reached) > 1:
        return np.interp(times, [0.0, *reached], grips)

    return grips[0] + (grips[1] - grips[0]) * times / reached[0]


def _compare_with_asked(reached: Array, wanted: Array, waits: Array) -> Array:
    """Compute how many times longer each way takes than asked.

    Args:
        reached: (N,) when the waypoints are reached, seconds.
        wanted: (N,) how long the ways are asked to take, seconds; nan: nothing is asked.
        waits: (N,) the rests at the waypoints, seconds.

    Returns:
        Factors (N,), at least 1.
    """
    begins = np.concatenate([[0.0], reached[:-1] + waits[:-1]])
    slowed = np.maximum(1.0, (reached - begins) / wanted)

    return np.where(np.isfinite(wanted), slowed, 1.0)

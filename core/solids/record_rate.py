"""Choose how often a rollout is recorded and looked at, by the speed and the thinness of what moves.

A recording has as many samples as its fastest moment near a body asks for. Most of it is looked at about `SAMPLE_HZ`
times a second (`coarse_samples`), and more often only where thin solids are near each other (`refined_samples`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import chain

import numpy as np

from core.design import Tool
from core.geometry import Array, running_sums
from core.interfaces import JointTrajectory, Recording, Robot
from core.robot.kinematics import finger_values, robot_model
from core.robot.solids import Obstacles, body_solids
from core.scene import Scene
from core.solids.near_pairs import Flags
from core.solids.rollout_solids import all_solids
from core.solids.tracks import (
    SAMPLE_HZ,
    Detour,
    Indices,
    Rows,
    lengths,
    place_solids,
)

MAX_HZ = 1600.0  # beyond the rate of every engine's steps
_NEAR_M = 0.05  # of a body: the arm lags behind what it is told, and bodies settle

_EMPTY = Scene(())
_SAME = 1e-6  # of a sample; the end of a motion is not one sample more


@lru_cache(maxsize=8)
def thinnest(scene: Scene) -> float:
    """Find the smallest extent of all collision shapes of a scene, metres."""
    shapes = [part.shape for body in scene.bodies for part in body.collisions]
    return min((shape.thickness for shape in shapes), default=math.inf)


def sample_hz(
    robot: Robot,
    tool: Tool,
    trajectory: JointTrajectory,
    scene: Scene,
) -> float:
    """The rate at which the tool moves no farther between two samples than the thinnest solid is thick.

    Its speed counts while it is near a body, and always once the robot has been near one that can move: that may be as
    fast since then. A fast way through the air asks for nothing.

    The rate is `SAMPLE_HZ` times a power of two, so that there is a sample at each instant of a trace.

    Args:
        robot: what moves.
        tool: what it holds.
        trajectory: how it moves.
        scene: what it may meet.

    Returns:
        The rate, at most `MAX_HZ`.
    """
    thin = min([thinnest(scene), *(part.shape.thickness for part in tool.parts)])
    wanted = _bound_tool_speed(robot, tool, trajectory, scene) / thin

    return min(MAX_HZ, SAMPLE_HZ * _round_up(wanted / SAMPLE_HZ))


def _bound_tool_speed(
    robot: Robot, tool: Tool, trajectory: JointTrajectory, scene: Scene
) -> float:
    """Bound the speed of any point of a tool where it counts, m/s, averaged over a sample of `SAMPLE_HZ`."""
    if not tool.parts:
        return 0.0

    end = trajectory.duration
    count = math.ceil(end * SAMPLE_HZ - _SAME)
    times = np.append(np.arange(count) / SAMPLE_HZ, end)
    arm, opening = trajectory.sample(times)
    fingers = finger_values(robot, tool, opening)

    # The motion as it is commanded, in a scene without bodies.
    solids = all_solids(_EMPTY, robot, tool)
    model = robot_model(robot, tool)
    rotations, positions = model.place_joints(model.order(arm, fingers))
    rows = place_solids(solids, solids.moving, rotations, positions)
    parts = slice(-len(tool.parts), None)
    speeds = rows.ways[parts, :-1].max(axis=0) / np.diff(times)
    counts = _mark_meetings(rows, parts, scene)

    return float(speeds[counts].max(initial=0.0))


def _mark_meetings(rows: Rows, parts: slice, scene: Scene) -> Flags:
    """Mark the intervals in which a tool may meet a body, or a body another.

    Args:
        rows: the robot's solids that move, at T samples.
        parts: which of them are the tool's.
        scene: its bodies are where they begin, until the robot is near one that can move.

    Returns:
        Marks (T - 1,).
    """
    if _stirs(scene):
        return np.ones(rows.low.shape[1] - 1, dtype=bool)

    obstacles = _obstacles_of(scene)
    low = obstacles.centers - obstacles.halves - _NEAR_M
    high = obstacles.centers + obstacles.halves + _NEAR_M

    # Of each solid of the robot, in each interval, and for each of a body.
    below = rows.low[:, :-1, None] <= high
    above = rows.high[:, :-1, None] >= low
    near = (below & above).all(axis=3)

    free = [not scene[solid.owner].fixed for solid in obstacles.solids]
    stirred = near[:, :, np.array(free, dtype=bool)].any(axis=(0, 2))
    marked: Flags = near[parts].any(axis=(0, 2))
    marked |= np.logical_or.accumulate(stirred)
    return marked


def _stirs(scene: Scene) -> bool:
    """Whether something in a scene may move before the robot is near it.

    All other bodies are taken to rest where they begin.
    """
    if scene.joints or scene.bonds or scene.softs:
        return True

    return any(body.launched for body in scene.bodies)


@lru_cache(maxsize=8)
def _obstacles_of(scene: Scene) -> Obstacles:
    """Return the collision shapes of a scene's bodies, where they begin."""
    return Obstacles(chain.from_iterable(map(body_solids, scene.bodies)))


def _round_up(wanted: float) -> float:
    """Round up to a power of two, at least 1."""
    return 2.0 ** math.ceil(math.log2(max(wanted, 1.0)))


def is_finite(recording: Recording) -> bool:
    """Report whether all poses, velocities and joints are numbers."""
    arrays = (*recording.states.arrays[:3], recording.arm)
    return all(np.isfinite(array).all() for array in arrays)


def coarse_samples(recording: Recording) -> Indices:
    """The samples of a recording that are about `SAMPLE_HZ` apart, the first and the last among them."""
    times = recording.times
    last = len(times) - 1

    if last == 0:
        return np.array([0])

    rate = 1 / float(times[1] - times[0])
    every = max(1, round(rate / SAMPLE_HZ))
    return np.append(np.arange(0, last, every), last)


def refined_samples(samples: Indices, wanted: Array) -> Indices:
    """Choose more samples where they are wanted.

    Args:
        samples: (S,) those that there were looks at.
        wanted: (S - 1,) how often to look in each interval between them; 0: not at all.

    Returns:
        As many samples in each interval, if the recording has them, and both its ends.
    """
    taken = np.zeros(samples[-1] + 1, dtype=bool)
    taken[samples[:-1][wanted > 0]] = True
    taken[samples[1:][wanted > 0]] = True

    for k in np.flatnonzero(wanted > 1).tolist():
        begin, end = samples[k : k + 2].tolist()
        every = max(1, int((end - begin) / _round_up(wanted[k])))
        taken[begin:end:every] = True

    return np.flatnonzero(taken)


def subset(recording: Recording, samples: Indices) -> Recording:
    """Return only these samples of a recording, with the mean forces and largest loads since the one before."""
    times = recording.times
    forces = {
        pair: _average(times, values, samples)
        for pair, values in recording.forces.items()
    }
    loads = {
        name: largest_since(values, samples) for name, values in recording.loads.items()
    }

    return Recording(
        times[samples],
        recording.arm[samples],
        recording.fingers[samples],
        recording.states.each(lambda array: array[samples]),
        forces,
        loads=loads,
    )


def largest_since(values: Array, samples: Indices) -> Array:
    """Find the largest of values (T,) since the sample before, at each of some samples (S,), rising."""
    largest = values[samples].copy()
    if len(samples) > 1:
        behind = np.maximum.reduceat(values[1 : samples[-1] + 1], samples[:-1])
        largest[1:] = np.maximum(largest[1:], behind)

    return largest


def _average(times: Array, values: Array, samples: Indices) -> Array:
    """Average values over the time since the sample before.

    Args:
        times: (T,) instants, seconds.
        values: (T,) each a mean since the instant before.
        samples: (S,) the instants that are kept.

    Returns:
        Means (S,).
    """
    impulses = running_sums(values[1:] * np.diff(times))[samples]
    lasts = np.diff(times[samples], prepend=times[0])
    means = np.diff(impulses, prepend=0.0) / np.maximum(lasts, 1e-9)
    means[samples == 0] = values[0]

    return means


def detours(recording: Recording, samples: Indices, slides: Sequence[bool]) -> Detour:
    """How far the robot and each free body get from the straight way between two of the `coarse_samples`, at most.

    ``slides`` (J,): whether each of the arm's joints does.
    """
    states = recording.states
    arm = _deviate(recording.arm, samples)
    fingers = _deviate(recording.fingers, samples)
    moved = lengths(_deviate(states.positions, samples))
    turned = 2 * lengths(_deviate(states.quaternions, samples))
    sliding = np.array(slides, dtype=bool)
    slid = fingers.max(axis=1, initial=0.0) + arm[:, sliding].sum(axis=1)
    return Detour(
        moved=np.column_stack([slid, moved]).T,
        turned=np.column_stack([arm[:, ~sliding].sum(axis=1), turned]).T,
    )


def _deviate(values: Array, samples: Indices) -> Array:
    """Measure how far values get from the straight way from a sample to the next, at most.

    Args:
        values: (T, ...) at all instants.
        samples: (S,) the numbers of some of them.

    Returns:
        Deviations (S, ...); 0 after the last sample.
    """
    known = values[samples]
    if len(known) == len(values):
        return np.zeros_like(known)

    numbers = np.arange(len(values))
    before = np.searchsorted(samples[1:-1], numbers, side="right")
    shares = (numbers - samples[before]) / np.diff(samples)[before]
    ways = np.diff(known, axis=0)[before]
    straight = known[before] + (shares * ways.T).T

    return np.maximum.reduceat(np.abs(values - straight), samples)

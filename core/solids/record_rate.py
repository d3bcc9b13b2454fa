"""Choose how often a rollout is recorded and looked at, by the speed and the thinness of what moves."""

from __future__ import annotations

import math

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.interfaces import JointTrajectory, Recording, Robot
from core.robot.kinematics import finger_values
from core.scene import Scene, State
from core.solids.bodies import thickness
from core.solids.tracks import SAMPLE_HZ, Detour, Indices, follow, lengths

MAX_HZ = 1600.0  # beyond the rate of every engine's steps


def thinnest(scene: Scene) -> float:
    """Find the smallest extent of all collision shapes of a scene, metres."""
    return min(
        (thickness(part.shape) for body in scene.bodies for part in body.collisions),
        default=math.inf,
    )


def sample_hz(
    robot: Robot, tool: Tool, trajectory: JointTrajectory, thin: float
) -> float:
    """The rate at which the tool moves no farther between two samples than the thinnest solid is thick.

    ``thin`` is that of the scene, metres. The rate is `SAMPLE_HZ` times a power of two, so that there are few.
    """
    thin = min([thin, *(thickness(part.shape) for part in tool.parts)])
    return min(
        MAX_HZ,
        SAMPLE_HZ * _power(_tool_speed(robot, tool, trajectory) / thin / SAMPLE_HZ),
    )


def _tool_speed(robot: Robot, tool: Tool, trajectory: JointTrajectory) -> float:
    """Bound the speed of any point of a tool on its way, m/s, averaged over a sample of `SAMPLE_HZ`."""
    times = np.append(
        np.arange(0.0, trajectory.duration, 1 / SAMPLE_HZ), trajectory.duration
    )
    arm, opening = trajectory.sample(times)
    triples = np.empty((len(times), 0, 3))
    bodies = State((), triples, np.empty((len(times), 0, 4)), triples, triples)
    recording = Recording(times, arm, finger_values(robot, tool, opening), bodies)
    parts = (
        list(follow(Scene(()), robot, tool, recording))[-len(tool.parts) :]
        if tool.parts
        else []
    )
    speeds = [np.diff(part.travel) / np.diff(times) for part in parts]
    return max((float(speed.max(initial=0.0)) for speed in speeds), default=0.0)


def _power(wanted: float) -> float:
    """Round up to a power of two, at least 1."""
    return 2.0 ** math.ceil(math.log2(max(wanted, 1.0)))


def is_finite(recording: Recording) -> bool:
    """Report whether all poses, velocities and joints are numbers."""
    states = recording.states
    values = (
        states.positions,
        states.quaternions,
        states.linear_velocities,
        recording.arm,
    )
    return all(bool(np.isfinite(array).all()) for array in values)


def coarse_samples(recording: Recording) -> Indices:
    """The samples of a recording that are about `SAMPLE_HZ` apart, the first and the last among them."""
    count = len(recording.times)
    every = (
        max(1, round(1 / (SAMPLE_HZ * float(recording.times[1] - recording.times[0]))))
        if count > 1
        else 1
    )
    return np.append(np.arange(0, count - 1, every), count - 1)


def refined_samples(samples: Indices, wanted: Array) -> Indices:
    """Return as many samples as ``wanted`` in each interval (S - 1,), if there are, and both its ends; 0: not these."""
    taken = np.zeros(samples[-1] + 1, dtype=bool)
    taken[samples[:-1][wanted > 0]] = taken[samples[1:][wanted > 0]] = True
    for k in np.flatnonzero(wanted > 1).tolist():
        begin, end = samples[k : k + 2].tolist()
        taken[begin : end : max(1, int((end - begin) / _power(wanted[k])))] = True
    return np.flatnonzero(taken)


def subset(recording: Recording, samples: Indices) -> Recording:
    """Return only these samples of a recording, and the mean force since the one before."""
    states = recording.states.each(lambda array: array[samples])
    forces = {
        pair: _means(recording.times, values, samples)
        for pair, values in recording.forces.items()
    }
    return Recording(
        recording.times[samples],
        recording.arm[samples],
        recording.fingers[samples],
        states,
        forces,
    )


def _means(times: Array, values: Array, samples: Indices) -> Array:
    """Average ``values`` (T,), each a mean since the instant before, over the time since the sample before."""
    impulses = np.concatenate([[0.0], np.cumsum(values[1:] * np.diff(times))])[samples]
    means = np.diff(impulses, prepend=0.0) / np.maximum(
        np.diff(times[samples], prepend=times[0]), 1e-9
    )
    means[samples == 0] = values[0]
    return means


def detours(recording: Recording, samples: Indices) -> Detour:
    """How far the robot and each free body get from the straight way between two of the `coarse_samples`, at most."""
    states, count = recording.states, len(recording.times)
    parts = (
        recording.arm,
        recording.fingers,
        states.positions.reshape(count, -1),
        states.quaternions.reshape(count, -1),
    )
    values = np.concatenate(parts, axis=1)
    aside = _aside(values, samples)
    joints, places = (
        sum(part.shape[1] for part in parts[:number]) for number in (2, 3)
    )
    moved, turned = np.empty((2, 1 + len(states.names), len(samples)))
    moved[0] = aside[:, recording.arm.shape[1] : joints].max(axis=1, initial=0.0)
    turned[0] = aside[:, : recording.arm.shape[1]].sum(axis=1)
    moved[1:] = lengths(aside[:, joints:places].reshape(len(samples), -1, 3)).T
    turned[1:] = 2 * lengths(aside[:, places:].reshape(len(samples), -1, 4)).T
    return Detour(moved, turned)


def _aside(values: Array, samples: Indices) -> Array:
    """The largest distance of each of ``values`` (T, N) from the line between two samples (S,): (S, N), the last 0.

    Samples are evenly apart, but for the last.
    """
    aside, every = np.zeros((len(samples), values.shape[1])), int(samples[:2][-1])
    if len(samples) == len(values):
        return aside
    whole = int(samples[-1]) // every  # only the last interval may be shorter
    for begin, end, count in (
        (0, whole, every),
        (whole, len(samples) - 1, int(samples[-1]) - whole * every),
    ):
        if begin < end and count > 1:
            known = values[samples[begin : end + 1]][:, None]
            away = (known[1:] - known[:-1]) * (np.arange(count) / count)[:, None]
            away += known[:-1]
            away -= values[samples[begin] : samples[end]].reshape(
                end - begin, count, -1
            )
            np.abs(away, out=away).max(axis=1, out=aside[begin:end])
    return aside

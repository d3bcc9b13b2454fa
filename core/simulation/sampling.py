"""Choose how often a rollout is recorded and looked at, by the speed and the thinness of what moves.

Covered by `tests/core/simulation/test_sampling.py`.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from core.design import Tool
from core.geometry import Array
from core.interfaces import JointTrajectory, Recording, Robot
from core.scene import Scene, State
from core.simulation.tracks import SAMPLE_HZ, Detour, thickness, tool_speed

MAX_HZ = 1600.0  # beyond the rate of every engine's steps

Indices = npt.NDArray[np.intp]


def thinnest(scene: Scene) -> float:
    """Find the smallest extent of all collision shapes of a scene, metres."""
    return min((thickness(part.shape) for body in scene.bodies for part in body.collisions), default=math.inf)


def sample_hz(robot: Robot, tool: Tool, trajectory: JointTrajectory, thin: float) -> float:
    """The rate at which the tool moves no farther between two samples than the thinnest solid is thick.

    ``thin`` is that of the scene, metres. The rate is `SAMPLE_HZ` times a power of two, so that there are few.
    """
    thin = min([thin, *(thickness(part.shape) for part in tool.parts)])
    return min(MAX_HZ, SAMPLE_HZ * _power(tool_speed(robot, tool, trajectory) / thin / SAMPLE_HZ))


def _power(wanted: float) -> float:
    """Round up to a power of two, at least 1."""
    return 2.0 ** math.ceil(math.log2(max(wanted, 1.0)))


def is_finite(recording: Recording) -> bool:
    """Report whether all poses, velocities and joints are numbers."""
    states = recording.states
    values = states.positions, states.quaternions, states.linear_velocities, recording.arm
    return all(bool(np.isfinite(array).all()) for array in values)


def coarse_samples(recording: Recording) -> Indices:
    """The samples of a recording that are about `SAMPLE_HZ` apart, the first and the last among them."""
    count = len(recording.times)
    every = max(1, round(1 / (SAMPLE_HZ * float(recording.times[1] - recording.times[0])))) if count > 1 else 1
    return np.append(np.arange(0, count - 1, every), count - 1)


def refined_samples(samples: Indices, wanted: Array) -> Indices:
    """Add samples where there are ``wanted`` (S - 1,) times as many between two, if the recording has so many."""
    parts = [samples]
    for k in np.flatnonzero(wanted > 1):
        between = samples[k + 1] - samples[k]
        parts.append(np.arange(samples[k], samples[k + 1], max(1, int(between / _power(wanted[k])))))
    return np.unique(np.concatenate(parts))


def subset(recording: Recording, samples: Indices) -> Recording:
    """Return only these samples of a recording, and the mean force since the one before."""
    states = State(recording.states.names, *(array[samples] for array in recording.states.arrays))
    forces = {pair: _means(recording.times, values, samples) for pair, values in recording.forces.items()}
    return Recording(recording.times[samples], recording.arm[samples], recording.fingers[samples], states, forces)


def _means(times: Array, values: Array, samples: Indices) -> Array:
    """Average ``values`` (T,), each a mean since the instant before, over the time since the sample before."""
    impulses = np.concatenate([[0.0], np.cumsum(values[1:] * np.diff(times))])[samples]
    means = np.diff(impulses, prepend=0.0) / np.maximum(np.diff(times[samples], prepend=times[0]), 1e-9)
    means[samples == 0] = values[0]
    return means


def detours(recording: Recording, samples: Indices) -> tuple[Detour, list[Detour]]:
    """How far the robot and each free body get from the straight way between two of ``samples``, at most."""
    states, count = recording.states, len(recording.times)
    moved, turned = states.positions.reshape(count, -1), states.quaternions.reshape(count, -1)
    arrays = (recording.arm, recording.fingers, moved, turned)
    aside = _aside(np.concatenate(arrays, axis=1), samples)
    arm, fingers, moved, turned = np.split(aside, np.cumsum([array.shape[1] for array in arrays[:3]]), axis=1)
    moved = np.sqrt((moved.reshape(len(samples), -1, 3) ** 2).sum(axis=2))
    turned = 2 * np.sqrt((turned.reshape(len(samples), -1, 4) ** 2).sum(axis=2))
    robot = Detour(fingers.max(axis=1, initial=0.0), arm.sum(axis=1))
    return robot, [Detour(moved[:, i], turned[:, i]) for i in range(len(states.names))]


def _aside(values: Array, samples: Indices) -> Array:
    """The largest distance of each of ``values`` (T, N) from the line between two samples (S,): (S, N), the last 0."""
    at = np.arange(len(values))
    before = np.repeat(np.arange(len(samples) - 1), np.diff(samples))
    share = ((at[:-1] - samples[before]) / np.diff(samples)[before])[:, None]
    known = values[samples]
    away = np.diff(known, axis=0)[before]
    away *= share  # in place: recordings with many bodies are large
    away += known[before]
    away -= values[:-1]
    aside = np.maximum.reduceat(np.abs(away, out=away), samples[:-1], axis=0)
    return np.append(aside, np.zeros((1, values.shape[1])), axis=0)

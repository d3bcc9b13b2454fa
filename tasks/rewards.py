"""Figures that the rewards of several tasks read from states, over any leading axes."""

from __future__ import annotations

import numpy as np

from core.geometry import Array
from core.scene import State
from core.values.joints import rotate


def length(vectors: Array) -> Array:
    """Return the lengths (...) of vectors (..., N)."""
    lengths: Array = np.linalg.norm(vectors, axis=-1)
    return lengths


def speed(state: State, name: str) -> Array:
    """Return how fast a body moves, m/s."""
    return length(state.linear_velocity(name))


def moved(start: State, end: State, name: str) -> Array:
    """Return how far a body moved, metres."""
    return length(end.position(name) - start.position(name))


def apart(state: State, one: str, other: str) -> Array:
    """Return how far apart two bodies are as seen from above, metres."""
    return length((state.position(one) - state.position(other))[..., :2])


def z_axis(state: State, name: str) -> Array:
    """Return where a body's z axis points in the world, (..., 3)."""
    return rotate(state.quaternion(name), np.array([0.0, 0.0, 1.0]))


def split(vectors: Array) -> Array:
    """Return the coordinates of vectors (..., 3) one by one, (3, ...)."""
    return np.moveaxis(vectors, -1, 0)


def share(values: Array) -> Array:
    """Cut values to 0 at least and 1 at most."""
    return np.clip(values, 0.0, 1.0)


def progress(left: Array, whole: Array | float) -> Array:
    """Return the share of a way that is done, 0 to 1, by what is ``left`` of the ``whole``."""
    return share(1 - left / whole)

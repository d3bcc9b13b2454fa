"""Bound the gaps between two solids at many samples at once.

Along any direction the gap between two convex solids is no larger than their distance. Covered by
`tests/core/simulation/test_gaps.py`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from core.geometry import Array, Box, Cylinder, Shape, Sphere
from core.simulation.tracks import Track


def gap_bounds(one: Track, other: Track, samples: npt.NDArray[np.intp]) -> Array | None:
    """Lower bounds (N,) of the gaps between two solids, metres, negative if they overlap; None for hulls.

    They are exact where the gap is along an axis of either frame, or along the radius of a ball or a cylinder.
    """
    if not isinstance(one.shape, Box | Cylinder | Sphere) or not isinstance(other.shape, Box | Cylinder | Sphere):
        return None
    (rotation, position), (others_rotation, others_position) = _frames(one, samples), _frames(other, samples)
    back = others_rotation.swapaxes(1, 2)
    turned, ahead = back @ rotation, (back @ (position - others_position)[:, :, None])[:, :, 0]
    return np.maximum(
        _seen(other.shape, one.shape, turned, ahead),
        _seen(one.shape, other.shape, turned.swapaxes(1, 2), -(ahead[:, None] @ turned)[:, 0]),
    )


def _frames(track: Track, samples: npt.NDArray[np.intp]) -> tuple[Array, Array]:
    if len(track.positions) == 1:
        return track.rotations, track.positions
    return track.rotations[samples], track.positions[samples]


def _seen(shape: Shape, other: Shape, turned: Array, ahead: Array) -> Array:
    """The largest gap along the axes and a radius of ``shape``; rotations and positions of the other in its frame."""
    gaps = np.abs(ahead) - _reach(other, turned.swapaxes(1, 2))
    match shape:
        case Box(size):
            largest: Array = (gaps - np.asarray(size) / 2).max(axis=1)
        case Sphere(radius):
            out, far = _unit(ahead)
            largest = far - radius - _reach(other, (turned.swapaxes(1, 2) @ out[:, :, None]))[:, 0]
        case Cylinder(radius, length):
            out, far = _unit(ahead * (1.0, 1.0, 0.0))
            radial = far - radius - _reach(other, (turned.swapaxes(1, 2) @ out[:, :, None]))[:, 0]
            largest = np.maximum(gaps[:, 2] - length / 2, radial)
    if isinstance(shape, Box) and isinstance(other, Sphere):  # near an edge or a corner of the box
        beyond = np.maximum(np.abs(ahead) - np.asarray(shape.size) / 2, 0.0)
        far = np.sqrt((beyond * beyond).sum(axis=1))
        largest = np.where(far > 0, far - other.radius, largest)
    return largest


def _unit(vectors: Array) -> tuple[Array, Array]:
    """Directions (N, 3) and lengths (N,)."""
    lengths = np.sqrt((vectors * vectors).sum(axis=1))
    return vectors / np.maximum(lengths, 1e-12)[:, None], lengths


def _reach(shape: Shape, directions: Array) -> Array:
    """How far a shape extends from its middle along K directions (N, 3, K) of its frame: (N, K)."""
    match shape:
        case Box(size):
            reach: Array = (np.abs(directions) * (np.asarray(size) / 2)[:, None]).sum(axis=1)
        case Cylinder(radius, length):
            across = np.sqrt(directions[:, 0] ** 2 + directions[:, 1] ** 2)
            reach = radius * across + length / 2 * np.abs(directions[:, 2])
        case Sphere(radius):
            reach = np.full((len(directions), directions.shape[2]), radius)
        case _:
            raise TypeError(shape)
    return reach

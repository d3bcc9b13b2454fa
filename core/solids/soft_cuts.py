"""Find what of the robot got into soft solids: blades and needles slip between the nodes that an engine holds apart.

A soft solid gives way, so its elements are read where they are: what is inside one of them, and farther from the
surface than an engine's contacts let it, cuts the solid.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull

from core.geometry import Array, Shape
from core.scene import Filling, Scene, Soft, State
from core.solids.passage import DEEP_S
from core.solids.rollout_solids import ROBOT
from core.solids.tracks import Track, Tracks

CUT_M = 0.006
"""How deep under the surface of a soft solid nothing may get, beyond the thickness of its skin."""

_SPACING_M = 0.004  # of the points by which a solid of the robot is looked at
_MOST_POINTS = 12  # along each side
_EDGE = 1e-6  # of barycentric coordinates


class Cut(NamedTuple):
    """A solid of the robot inside a soft body: names, since when, seconds, and how deep at most, metres."""

    name: str
    soft: str
    time_s: float
    depth_m: float


def find_cuts(scene: Scene, tracks: Tracks, states: State) -> Iterator[Cut]:
    """Find which solids of the robot stay too deep in soft solids.

    Args:
        scene: its soft bodies.
        tracks: of the robot, at T samples.
        states: the nodes of soft bodies at the same samples.
    """
    for soft in scene.softs:
        if not isinstance(soft.form, Filling):
            continue

        nodes = states.nodes(soft.name)
        for track in tracks.items:
            if track.owner == ROBOT and track.shape is not None:
                depths = _measure_depths(soft, nodes, track, track.shape)
                cut = _find_cut(soft, track, tracks.times, depths)
                if cut is not None:
                    yield cut


def _find_cut(soft: Soft, track: Track, times: Array, depths: Array) -> Cut | None:
    """Find where depths (T,) are too large for longer than a blow lasts."""
    deep = depths > CUT_M + soft.form.thickness
    begun: float | None = None

    for now, too_deep in zip(times.tolist(), deep.tolist(), strict=True):
        if not too_deep:
            begun = None
        elif begun is None:
            begun = now
        if begun is not None and now - begun >= DEEP_S:
            return Cut(track.name, soft.name, begun, float(depths.max()))

    return None


def _measure_depths(soft: Soft, nodes: Array, track: Track, shape: Shape) -> Array:
    """Measure how deep a solid is under the surface of a soft one at each sample, metres.

    Args:
        soft: whose elements count.
        nodes: (T, N, 3) where its nodes are.
        track: of the solid.
        shape: of the solid.

    Returns:
        Depths (T,); 0 where nothing of it is inside.
    """
    low = nodes.min(axis=1)
    high = nodes.max(axis=1)
    near = (track.low <= high).all(axis=1) & (track.high >= low).all(axis=1)
    depths = np.zeros(len(nodes))
    points = _sample(shape)

    for sample in np.flatnonzero(near).tolist():
        placed = points @ track.rotations[sample].T + track.positions[sample]
        within = (placed >= low[sample]).all(axis=1)
        within &= (placed <= high[sample]).all(axis=1)
        depths[sample] = _measure_deepest(soft, nodes[sample], placed[within])

    return depths


def _measure_deepest(soft: Soft, nodes: Array, points: Array) -> float:
    """Measure how deep the deepest of points (P, 3) is under the surface of a soft solid, metres."""
    corners = nodes[soft.form.elements]
    edges = (corners[:, 1:] - corners[:, :1]).swapaxes(1, 2)
    whole = np.abs(np.linalg.det(edges)) > 1e-15
    apart = points[:, None] - corners[whole, 0]
    shares = np.einsum("eij,pej->pei", np.linalg.inv(edges[whole]), apart)
    last = 1 - shares.sum(axis=2, keepdims=True)
    within = np.concatenate([shares, last], axis=2) >= -_EDGE
    inner = points[np.any(np.all(within, axis=2), axis=1)]

    if not len(inner):
        return 0.0

    from trimesh.proximity import closest_point_naive  # takes long

    surface = soft.form.surface(nodes).to_trimesh()
    _, distances, _ = closest_point_naive(surface, inner)
    return float(distances.max())


@lru_cache(maxsize=256)
def _sample(shape: Shape) -> Array:
    """Place points (P, 3) evenly in a shape; in what is thin, also in its middle."""
    middle, sides = shape.bounds
    axes = []

    for at, side in zip(middle.tolist(), sides.tolist(), strict=True):
        count = min(max(math.ceil(side / _SPACING_M), 2), _MOST_POINTS)
        axes.append(np.linspace(at - side / 2, at + side / 2, count + 1 - count % 2))

    points = np.array(list(product(*axes)))
    planes = ConvexHull(shape.to_trimesh().vertices).equations
    within = (points @ planes[:, :3].T + planes[:, 3] <= 1e-9).all(axis=1)
    return np.asarray(points[within])

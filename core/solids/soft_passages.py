"""Find what ropes and cloths passed through: between their nodes, or past an engine's contacts that gave way.

A rope's middle line and a cloth's middle sheet are followed by points that keep their places in the elements, in the
frame of each solid. A point remembers the face through which it came in. It may press the solid as deep as contacts
let it; what leaves on the other side, or stays far beneath that face, went through.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import coal
import numpy as np
from scipy.spatial import ConvexHull

from core.geometry import Array
from core.robot.solids import corners
from core.scene import Filling, Scene, Soft, State
from core.solids.passage import DEEP_S
from core.solids.soft_cuts import CUT_M, Cut
from core.solids.tracks import Indices, Track, Tracks, lengths

THROUGH = 0.5
"""The share of a solid's extent, square to the face where a point came in, beneath which it leaves elsewhere."""

_SPACINGS_M = (1e-3, 5e-3)  # the least and the most between two points

_OUTSIDE = -1  # instead of the number of a face
_FROM_START = -2  # it was inside before it was followed


class Faces(NamedTuple):
    """The F faces of a convex solid, in its frame.

    Attributes:
        normals: (F, 3) outward.
        offsets: (F,) so that ``normals @ x + offsets`` is how far x is beyond each, metres.
        extents: (F,) of the solid, square to each face, metres.
        low: (3,), with ``high`` (3,) its bounding box.
    """

    normals: Array
    offsets: Array
    extents: Array
    low: Array
    high: Array


def find_soft_passages(scene: Scene, tracks: Tracks, states: State) -> Iterator[Cut]:
    """Find which solids ropes and cloths went through; the first time of each two things.

    Args:
        scene: its soft bodies.
        tracks: of the robot and of bodies, at T samples.
        states: the nodes of soft bodies at the same samples.
    """
    for soft in scene.softs:
        if isinstance(soft.form, Filling):
            continue

        nodes = states.nodes(soft.name)
        for track in tracks.items:
            passage = _Passage(soft, track, tracks.times)
            cut = passage.find(nodes)
            if cut is not None:
                yield cut


class _Passage:
    """The points of a soft body, on their way past one solid."""

    def __init__(self, soft: Soft, track: Track, times: Array) -> None:
        self.soft = soft
        self.track = track
        self.times = times
        self.allowed = CUT_M + soft.form.thickness

    def find(self, nodes: Array) -> Cut | None:
        """Find when the first point went through; ``nodes`` (T, N, 3) are those of the soft body."""
        low = nodes.min(axis=1)
        high = nodes.max(axis=1)
        below = self.track.low[:-1] <= np.maximum(high[:-1], high[1:])
        above = self.track.high[:-1] >= np.minimum(low[:-1], low[1:])
        intervals = np.flatnonzero((below & above).all(axis=1))
        faces = _find_faces(self.track) if len(intervals) else None

        if faces is None:
            return None

        self._begin(nodes, faces)
        for k in intervals.tolist():
            local = [self._bring_near(nodes, sample) for sample in (k, k + 1)]
            found = self._look(local[0], local[1], k, faces)
            if found is not None:
                time, depth = found
                return Cut(self.track.name, self.soft.name, time, depth)

        return None

    def _begin(self, nodes: Array, faces: Faces) -> None:
        """Spread points over the elements, all of them outside."""
        thin = float(faces.extents.min())
        spacing = min(max(thin / 2, _SPACINGS_M[0]), _SPACINGS_M[1])
        corner_nodes = nodes[0][self.soft.form.elements]
        longest = float(lengths(corner_nodes[:, 1:] - corner_nodes[:, :1]).max())
        self.weights = _spread(corner_nodes.shape[1], math.ceil(longest / spacing))

        shape = (len(corner_nodes), len(self.weights))
        self.entries = np.full(shape, _OUTSIDE)
        self.deep_since = np.full(shape, np.inf)
        self.last_look = -2

    def _bring_near(self, nodes: Array, sample: int) -> Array:
        """Return the nodes (N, 3) of a sample in the frame of the solid."""
        apart = nodes[sample] - self.track.positions[sample]
        local: Array = apart @ self.track.rotations[sample]
        return local

    def _look(
        self, begin: Array, end: Array, k: int, faces: Faces
    ) -> tuple[float, float] | None:
        """Follow the points straight from a sample to the next: when and how deep the first that went through was."""
        numbers = self._meet(begin, end, k, faces)
        if not len(numbers):
            return None

        elements = self.soft.form.elements
        first = self.weights @ begin[elements[numbers]]
        last = self.weights @ end[elements[numbers]]
        heights = first @ faces.normals.T + faces.offsets
        rates = last @ faces.normals.T + faces.offsets - heights
        comes, faces_met, goes = _clip(heights, rates)

        crosses = (comes < goes) & (goes > 0.0) & (comes < 1.0)
        enters = crosses & (comes > 0.0)
        entries = np.where(enters, faces_met, self.entries[numbers])
        entries[crosses & (entries == _OUTSIDE)] = _FROM_START

        known = np.maximum(entries, 0)[..., None]
        leaves = np.clip(goes, 0.0, 1.0)
        beneath = np.take_along_axis(heights, known, axis=2)[..., 0]
        beneath += leaves * np.take_along_axis(rates, known, axis=2)[..., 0]
        depths = np.where(crosses & (entries >= 0), -beneath, 0.0)
        stays = crosses & (goes >= 1.0)
        is_through = (goes < 1.0) & (depths > THROUGH * faces.extents[known[..., 0]])

        now = float(self.times[k + 1])
        deep = stays & (depths > self.allowed)
        since = np.where(deep, np.minimum(self.deep_since[numbers], now), np.inf)
        is_through |= deep & (now - since >= DEEP_S)
        self.entries[numbers] = np.where(stays, entries, _OUTSIDE)
        self.deep_since[numbers] = since

        if not is_through.any():
            return None

        before = float(self.times[k])
        time = before + float(leaves[is_through].min()) * (now - before)
        return time, float(depths[is_through].max())

    def _meet(self, begin: Array, end: Array, k: int, faces: Faces) -> Indices:
        """Return the elements that come near the solid between two samples; the points of others are outside."""
        elements = self.soft.form.elements
        both = np.concatenate([begin[elements], end[elements]], axis=1)
        met = (both.min(axis=1) <= faces.high) & (both.max(axis=1) >= faces.low)
        is_near = met.all(axis=1)

        goes_on = self.last_look == k - 1
        self.last_look = k
        forgotten = ~is_near | (not goes_on)
        self.entries[forgotten] = _OUTSIDE
        self.deep_since[forgotten] = np.inf

        return np.flatnonzero(is_near)


def _clip(heights: Array, rates: Array) -> tuple[Array, Indices, Array]:
    """Clip straight ways of points (...) by the F faces of a convex solid.

    Args:
        heights: (..., F) how far points are beyond the faces at first, metres.
        rates: (..., F) how much that grows on their ways.

    Returns:
        The share of its way at which each point comes in (...), through which face (...), and at which share it
        leaves (...). It is never inside where it leaves before it comes in.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = -heights / rates

    coming = np.where(rates < 0, shares, -np.inf)
    going = np.where(rates > 0, shares, np.inf)
    beside = (rates == 0) & (heights > 0)
    coming[beside] = np.inf

    return coming.max(axis=-1), coming.argmax(axis=-1), going.min(axis=-1)


@lru_cache(maxsize=64)
def _spread(count: int, parts: int) -> Array:
    """Spread points over an element with ``count`` corners, ``parts`` to an edge: the corners' weights (P, count)."""
    places = [
        (*shares, parts - sum(shares))
        for shares in product(range(parts + 1), repeat=count - 1)
        if sum(shares) <= parts
    ]
    weights: Array = np.array(places, dtype=np.float64) / parts
    return weights


def _find_faces(track: Track) -> Faces | None:
    """Find the faces of a solid; None: it is round, and only its robot's description knows how."""
    if track.shape is not None:
        points = np.asarray(track.shape.to_trimesh().vertices)
    elif isinstance(track.geometry, coal.ConvexBase | coal.Box):
        points = corners(track.geometry)
    else:
        return None

    planes = np.unique(ConvexHull(points).equations.round(9), axis=0)
    normals = planes[:, :3]
    offsets = planes[:, 3]
    extents = -(points @ normals.T + offsets).min(axis=0)

    return Faces(normals, offsets, extents, points.min(axis=0), points.max(axis=0))

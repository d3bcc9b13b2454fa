"""Find by rays where a rod can push a body, and where tines get under it.

The results are the same for all subgoals of the same bodies, and are kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar, cast

import numpy as np
from scipy.ndimage import minimum_filter

from core.geometry import Array, Pose
from plugins.vlms.offline.boxes import Boxes, axes_of
from plugins.vlms.offline.scene_analysis import UP, Subgoal

_GRID_M = 0.003  # between rays
_MOST_RAYS = 50  # side by side
_AROUND_M = 0.04  # how far beside the bodies rays pass
_HALF_M = (0.01, 0.007, 0.004)  # of what may fit through an opening, the stoutest first

P = ParamSpec("P")
R = TypeVar("R")


def _kept(
    find: Callable[Concatenate[Subgoal, P], R],
) -> Callable[Concatenate[Subgoal, P], R]:
    @wraps(find)
    def look(subgoal: Subgoal, /, *args: P.args, **kwargs: P.kwargs) -> R:
        key = (find.__name__, *map(id, subgoal.solids), repr((args, kwargs)))
        cache = subgoal.analysis.cache
        if key not in cache:
            cache[key] = find(subgoal, *args, **kwargs)
        return cast(R, cache[key])

    return look


def frame_of(way: Array) -> Pose:
    """Return the turn of a frame whose x points along ``way`` (3,), its y horizontal."""
    x, y, z = way / np.linalg.norm(way)
    yaw = np.arctan2(y, x) if np.hypot(x, y) > 1e-6 else 0.0
    return Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, -np.arcsin(np.clip(z, -1.0, 1.0)), yaw))


@dataclass(frozen=True, eq=False)
class Contact:
    """A point (3,) of a body where a rod of half width ``half`` gets, and how long it must be to stay outside."""

    point: Array
    half: float
    length: float


class _Rays:
    """Parallel rays through a scene, on a grid (U, V) around a subgoal's bodies, along x of ``turn``."""

    def __init__(self, subgoal: Subgoal, way: Array) -> None:
        self.turn = frame_of(way)
        points = self.turn.inverse().apply(subgoal.points)
        lower = points.min(axis=0) - _AROUND_M
        upper = points.max(axis=0) + _AROUND_M
        counts = np.minimum(
            np.ceil((upper - lower)[1:] / _GRID_M).astype(int), _MOST_RAYS
        )
        self.axes = [
            np.linspace(lower[i + 1], upper[i + 1], counts[i]) for i in range(2)
        ]
        self.steps = [float(axis[1] - axis[0]) for axis in self.axes]
        self.near, far = self._crossings(subgoal.boxes)
        self.other_near, other_far = self._crossings(subgoal.others)
        self.all = (
            np.concatenate([self.near, self.other_near], axis=-1),
            np.concatenate([far, other_far], axis=-1),
        )

    def _crossings(self, boxes: Boxes) -> tuple[Array, Array]:
        """Compute where each ray enters and leaves each box, (U, V, N); inf and -inf: it misses the box."""
        back = self.turn.rotation.as_matrix().T
        axes = np.einsum("ij,njk->nik", back, boxes.axes)
        centers = boxes.centers @ back.T
        u, v = np.meshgrid(*self.axes, indexing="ij")
        starts = np.stack([np.zeros_like(u), u, v], axis=-1)
        inside = np.einsum("nik,uvni->uvnk", axes, starts[:, :, None] - centers)
        slopes = np.where(
            np.abs(axes[:, 0]) < 1e-9, 1e-9, axes[:, 0]
        )  # of a ray, along each of a box's axes
        one = (-boxes.halves - inside) / slopes
        other = (boxes.halves - inside) / slopes
        near = np.minimum(one, other).max(axis=-1)
        far = np.maximum(one, other).min(axis=-1)
        missed = near >= far
        return np.where(missed, np.inf, near), np.where(missed, -np.inf, far)

    def window(self, half: float) -> tuple[int, ...]:
        """Return how many rays are within ``half`` of one, along both axes."""
        return tuple(2 * int(np.ceil(half / step)) + 1 for step in self.steps)

    def point(self, u: int, v: int, depth: float) -> Array:
        return self.turn.apply([depth, self.axes[0][u], self.axes[1][v]])

    def outside(self) -> Array:
        """Compute for each ray where the obstacles begin that are near it, (U, V)."""
        return minimum_filter(
            self.other_near.min(axis=-1, initial=np.inf), self.window(0.025)
        )


@_kept
def pushed(subgoal: Subgoal, way: Array, pole: Array | None = None) -> list[Contact]:
    """Find where a rod can push the bodies along ``way``, the best first.

    That is in the middle; with a ``pole`` (2, 3), a point of an axis that they turn about, and its direction, it is
    where they go the farthest along the way.
    """
    rays = _Rays(subgoal, way)
    hit = rays.near.min(axis=-1)
    blocked = rays.other_near.min(axis=-1, initial=np.inf)
    outside = rays.outside()
    for half in _HALF_M:
        free = minimum_filter(blocked, rays.window(half + 0.002)) > hit + 0.01
        contacts = []
        for u, v in np.argwhere(np.isfinite(hit) & free).tolist():
            point = rays.point(u, v, hit[u, v])
            length = float(np.clip(hit[u, v] - outside[u, v], 0.0, 0.4))
            across = np.linalg.norm(np.cross(way, point - subgoal.center))
            away = across if pole is None else -np.cross(pole[1], point - pole[0]) @ way
            contacts.append((float(away), Contact(point, half, length)))
        if contacts:
            return [
                contact
                for _, contact in sorted(contacts, key=lambda one: one[0])[
                    : max(1, len(contacts) // 6)
                ]
            ]
    return []


@dataclass(frozen=True, eq=False)
class Under:
    """Where two tines get under bodies along a heading.

    They are ``apart`` on each side of the line through ``rear`` (3,), which is where the bodies begin, at the height of
    their underside. Below it there is a gap ``room``, up to ``depth`` ahead.
    """

    heading: float
    rear: Array
    apart: float
    room: float
    depth: float

    @property
    def worth(self) -> float:
        return (
            min(self.depth, 0.06)
            + min(self.apart, 0.05)
            + self.room
            + float(self.rear[2])
        )


@_kept
def under(subgoal: Subgoal, heading: float, tine: float) -> Under | None:
    """Find where tines ``tine`` wide get under the bodies along a heading: high, wide apart, and far ahead."""
    rays = _Rays(subgoal, UP)
    near, far = rays.all
    ahead, side = (axis[:2] for axis in axes_of(heading))
    u, v = np.meshgrid(*rays.axes, indexing="ij")
    places = (
        rays.turn.apply(np.stack([np.zeros_like(u), u, v], axis=-1))[..., :2]
        - subgoal.center[:2]
    )
    along = places @ ahead
    across = np.abs(places @ side)
    found = list[Under]()
    levels = np.unique(rays.near[np.isfinite(rays.near)].round(3))
    for level in levels[:: -max(1, len(levels) // 12)]:
        low = (
            np.abs(rays.near - level).min(axis=-1) < 0.0015
        )  # an underside at this height
        for room in (0.02, 0.012, 0.006):
            full = ((near < level - 0.0016) & (far > level - room)).any(axis=-1)
            for apart in np.arange(
                0.0, float(across[low].max(initial=0.0)) + 1e-9, 2 * min(rays.steps)
            ):
                lane = np.abs(across - apart) < tine / 2 + min(rays.steps)
                if not (lane & low).any():
                    continue
                rear = float(along[lane & low].min())
                stop = float(
                    along[lane & full & (along > rear - _AROUND_M)].min(initial=1.0)
                )
                front = float(along[lane & low & (along < stop)].max(initial=rear))
                if stop > rear and front - rear > 0.008:
                    at = np.array([*(subgoal.center[:2] + rear * ahead), level])
                    found.append(Under(heading, at, float(apart), room, front - rear))
    return max(found, key=lambda one: one.worth) if found else None

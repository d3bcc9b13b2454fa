"""Oriented boxes as arrays, overlaps and gaps between them, and the axes of a heading."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.geometry import Array, Pose


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes in one frame: centres (N, 3), axes (N, 3, 3) with the boxes' own x, y, z as columns, half sides (N, 3)."""

    centers: Array
    axes: Array
    halves: Array

    @classmethod
    def of(cls, placed: Iterable[tuple[Pose, Array]]) -> Boxes:
        """From poses and full side lengths (3,)."""
        pairs = list(placed)
        return cls(
            np.array([pose.position for pose, _ in pairs]).reshape(-1, 3),
            np.array([pose.rotation.as_matrix() for pose, _ in pairs]).reshape(
                -1, 3, 3
            ),
            np.array([np.asarray(size) / 2 for _, size in pairs]).reshape(-1, 3),
        )

    @classmethod
    def join(cls, several: Iterable[Boxes]) -> Boxes:
        parts = [*several, cls.of(())]
        return cls(
            *(
                np.concatenate([getattr(part, name) for part in parts])
                for name in cls.__dataclass_fields__
            )
        )

    def __getitem__(
        self, chosen: npt.NDArray[np.intp] | npt.NDArray[np.bool_]
    ) -> Boxes:
        return Boxes(self.centers[chosen], self.axes[chosen], self.halves[chosen])

    @property
    def bounds(self) -> tuple[Array, Array]:
        """The lowest and highest corners (N, 3) of the axis-aligned bounding boxes."""
        reaches = np.einsum("nij,nj->ni", np.abs(self.axes), self.halves)
        return self.centers - reaches, self.centers + reaches

    def extents(self, way: Array, origin: Array) -> tuple[Array, Array]:
        """The least and the greatest coordinate (N,) of each box along ``way`` (3,), from ``origin`` (3,)."""
        middles = (self.centers - origin) @ way
        halves = np.abs(np.einsum("nji,j->ni", self.axes, way) * self.halves).sum(
            axis=1
        )
        return middles - halves, middles + halves

    def carried(self, positions: Array, rotations: Array) -> Boxes:
        """The boxes moved to each of K poses, with positions (K, 3) and rotation matrices (K, 3, 3): K * N boxes."""
        centers = np.einsum("kij,nj->kni", rotations, self.centers) + positions[:, None]
        axes = np.einsum("kij,njl->knil", rotations, self.axes)
        halves = np.broadcast_to(self.halves, centers.shape)
        return Boxes(
            centers.reshape(-1, 3), axes.reshape(-1, 3, 3), halves.reshape(-1, 3)
        )


def axes_of(heading: float) -> tuple[Array, Array]:
    """Unit vectors (3,) ahead and to the left."""
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    return ahead, np.array([-ahead[1], ahead[0], 0.0])


def overlaps(a: Boxes, b: Boxes, margin: float = 0.0) -> int:
    """The number of pairs, one box from each, closer than ``margin`` metres (negative: that overlap by more)."""
    lower, upper = a.bounds
    other_lower, other_upper = b.bounds
    near = (lower[:, None] - margin < other_upper) & (
        other_lower - margin < upper[:, None]
    )
    first, second = np.nonzero(near.all(axis=-1))
    gaps, _ = separations(a[first], b[second])
    return int((gaps < margin).sum())


def separations(a: Boxes, b: Boxes) -> tuple[Array, Array]:
    """For N pairs, the largest gap (N,) along a separating axis, negative for an overlap, and that axis (N, 3), from a
    to b. The axes that are compared are the face normals and the cross products of edges.
    """
    faces = a.axes.transpose(0, 2, 1)
    others = b.axes.transpose(0, 2, 1)
    axes = np.concatenate(
        [faces, others, np.cross(faces[:, :, None], others[:, None]).reshape(-1, 9, 3)],
        axis=1,
    )
    lengths = np.linalg.norm(axes, axis=-1, keepdims=True)
    parallel = lengths[..., 0] < 1e-6
    axes = axes / np.where(parallel[..., None], 1.0, lengths)
    between = np.einsum("nki,ni->nk", axes, b.centers - a.centers)
    extents = np.einsum("nkj,nj->nk", np.abs(axes @ a.axes), a.halves)
    extents += np.einsum("nkj,nj->nk", np.abs(axes @ b.axes), b.halves)
    gaps = np.where(parallel, -np.inf, np.abs(between) - extents)
    rows = np.arange(len(gaps))
    best = np.argmax(gaps, axis=1)
    signs = np.where(between[rows, best] < 0, -1.0, 1.0)
    return gaps[rows, best], axes[rows, best] * signs[:, None]

"""Oriented boxes as arrays, overlaps and gaps between them, and the directions that go with a heading."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.geometry import Array, Pose

UP = np.array([0.0, 0.0, 1.0])
LEVEL = np.array([1.0, 1.0, 0.0])
"""Times a vector (3,): its level part."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """N boxes in one frame.

        boxes = Boxes.from_poses([(pose, np.array([0.1, 0.1, 0.02]))])
        lower, upper = boxes.bounds
        along_way = boxes.moved_to(positions, rotations)

    Attributes:
        centers: (N, 3), metres.
        axes: (N, 3, 3), with the boxes' own x, y and z as columns.
        halves: half of the side lengths, (N, 3), metres.
    """

    centers: Array
    axes: Array
    halves: Array

    @classmethod
    def from_poses(cls, placed: Iterable[tuple[Pose, Array]]) -> Boxes:
        """Make boxes from poses and full side lengths (3,).

        Args:
            placed: the pose of each box in the common frame, and its full side lengths, metres.
        """
        centers = []
        axes = []

        halves = []

        for pose, size in placed:
            centers.append(pose.position)
            axes.append(pose.rotation_matrix)
            halves.append(np.asarray(size) / 2)

        return cls(
            np.reshape(centers, (-1, 3)),
            np.reshape(axes, (-1, 3, 3)),
            np.reshape(halves, (-1, 3)),
        )

    @classmethod
    def concatenate(cls, groups: Iterable[Boxes]) -> Boxes:
        """Put the boxes of all groups one after the other; of no groups, no boxes."""
        parts = [*groups, cls.from_poses(())]
        return cls(
            np.concatenate([part.centers for part in parts]),
            np.concatenate([part.axes for part in parts]),
            np.concatenate([part.halves for part in parts]),
        )

    def __getitem__(
        self, chosen: npt.NDArray[np.intp] | npt.NDArray[np.bool_]
    ) -> Boxes:
        return Boxes(self.centers[chosen], self.axes[chosen], self.halves[chosen])

    @property
    def bounds(self) -> tuple[Array, Array]:
        """The lowest and highest corners (N, 3) of the axis-aligned bounding boxes.

        Returns:
            Metres, in the frame of the boxes.
        """
        reaches = np.einsum("nij,nj->ni", np.abs(self.axes), self.halves)
        return self.centers - reaches, self.centers + reaches

    def ranges_along(self, way: Array, origin: Array) -> tuple[Array, Array]:
        """Compute the least and the greatest coordinate (N,) of each box along ``way`` (3,), from ``origin`` (3,).

        Returns:
            The least and the greatest coordinates, metres.
        """
        middles = (self.centers - origin) @ way
        slopes = np.einsum("nji,j->ni", self.axes, way)
        halves = np.abs(slopes * self.halves).sum(axis=1)

        return middles - halves, middles + halves

    def moved_to(self, positions: Array, rotations: Array) -> Boxes:
        """Copy the boxes to K poses: K * N boxes.

        Args:
            positions: of the frame that the boxes are given in, (K, 3).
            rotations: matrices of that frame, (K, 3, 3).
        """
        centers = np.einsum("kij,nj->kni", rotations, self.centers)
        centers = centers + positions[:, None]

        axes = np.einsum("kij,njl->knil", rotations, self.axes)
        halves = np.broadcast_to(self.halves, centers.shape)

        return Boxes(
            centers.reshape(-1, 3),
            axes.reshape(-1, 3, 3),
            halves.reshape(-1, 3),
        )


def heading_axes(heading: float) -> tuple[Array, Array]:
    """Compute the unit vectors (3,) ahead and to the left of a heading, radians about z.

    Args:
        heading: 0 along x.

    Returns:
        Both are level, in the frame that the heading is given in.
    """
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    left = np.array([-ahead[1], ahead[0], 0.0])

    return ahead, left


def count_overlaps(
    a: Boxes,
    b: Boxes,
    margin: float = 0.0,
) -> int:
    """Count the pairs that `find_overlaps` finds.

    Args:
        a: N boxes.
        b: M boxes in the same frame.
        margin: of distance, metres.
    """
    first, _ = find_overlaps(a, b, margin)
    return len(first)


def find_overlaps(
    a: Boxes,
    b: Boxes,
    margin: float = 0.0,
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Find the pairs, a box of each, that are closer than ``margin`` metres (negative: that overlap by more).

    Pairs whose bounding boxes are apart are left out before the others are measured.

    Args:
        a: N boxes.
        b: M boxes in the same frame.
        margin: of distance, metres.
    Returns:
        The numbers in ``a``, and those in ``b``, of the pairs that are too close.
    """
    lower, upper = a.bounds
    other_lower, other_upper = b.bounds
    begins_before = lower[:, None] - margin < other_upper

    ends_after = other_lower - margin < upper[:, None]
    near = (begins_before & ends_after).all(axis=-1)

    first, second = np.nonzero(near)
    gaps, _ = separations(a[first], b[second])

    close = gaps < margin
    return first[close], second[close]


def separations(a: Boxes, b: Boxes) -> tuple[Array, Array]:
    """Measure the gaps between N pairs of boxes, by the theorem of separating axes.

    The axes that are compared are the normals of faces, and the cross products of edges.

    Args:
        a: N boxes.
        b: N boxes in the same frame, each to be compared with the one of the same number.

    Returns:
        The largest gap (N,) along an axis, negative for an overlap; and that axis (N, 3), from a to b.
    """
    faces = a.axes.transpose(0, 2, 1)
    other_faces = b.axes.transpose(0, 2, 1)
    edges = np.cross(faces[:, :, None], other_faces[:, None]).reshape(-1, 9, 3)
    axes = np.concatenate([faces, other_faces, edges], axis=1)
    lengths = np.linalg.norm(axes, axis=-1, keepdims=True)
    parallel = lengths[..., 0] < 1e-6  # such edges give no axis
    axes = axes / np.where(parallel[..., None], 1.0, lengths)

    between = np.einsum("nki,ni->nk", axes, b.centers - a.centers)
    extents = np.einsum("nkj,nj->nk", np.abs(axes @ a.axes), a.halves)

    extents += np.einsum("nkj,nj->nk", np.abs(axes @ b.axes), b.halves)
    gaps = np.where(parallel, -np.inf, np.abs(between) - extents)

    rows = np.arange(len(gaps))
    best = np.argmax(gaps, axis=1)
    signs = np.where(between[rows, best] < 0, -1.0, 1.0)

    return gaps[rows, best], axes[rows, best] * signs[:, None]

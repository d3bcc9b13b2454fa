"""Divide ropes, cloths and soft solids into nodes and elements, weigh them and draw them; see `core.scene.Soft`."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import permutations
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from core.errors import refuse
from core.geometry import (
    Array,
    Mesh,
    Shape,
    Vector,
    frozen_array,
    running_sums,
    step_lengths,
)

Elements = npt.NDArray[np.int64]

MAX_NODES = 150  # the time of a step grows with them
SKIN_M = 0.002  # the thickness of a solid's skin, which collides; others are at least as thick
_CORNERS = 8  # of a rope's cross-section, as it is drawn


@dataclass(frozen=True)
class Elastic:
    """What a soft body is made of: it springs back from any strain.

    Attributes:
        density: kg/m^3.
        young: Young's modulus, Pa.
        poisson: Poisson's ratio.
        damping: the time in which viscosity acts, s.
        friction: the coefficient, as a body's.

    Raises:
        ValueError: a number is out of its range.
    """

    density: float
    young: float
    poisson: float = 0.3
    damping: float = 0.02
    friction: float = 0.5

    def __post_init__(self) -> None:
        ranges = {
            "density": (1, 1e4),
            "young": (1e3, 1e8),
            "poisson": (0, 0.45),
            "damping": (0, 1),
            "friction": (0, 10),
        }
        for name, (low, high) in ranges.items():
            value = getattr(self, name)
            problem = f"{name} must be from {low:g} to {high:g}, got {value}"
            refuse("", {problem: not low <= value <= high})


@dataclass(frozen=True)
class _Divided(ABC):
    """A shape that is divided into N nodes, and into E elements between them.

    Elements are segments, triangles or tetrahedra: simplices of D = 1, 2 or 3 dimensions.

    Attributes:
        nodes: (N, 3) in the body's frame, metres.
        elements: (E, D + 1) the numbers of each one's nodes.
        thickness: metres, of a rope, a sheet, or a solid's skin.

    Raises:
        ValueError: there are too many nodes, it is too thin, or an element has no size.
    """

    kind: ClassVar[str]
    most_young: ClassVar[float]  # Pa; above, an engine's step does not converge
    thickness: float = field(default=SKIN_M, kw_only=True)

    def __post_init__(self) -> None:
        where = f"a {self.kind} "
        few = min(self.counts) >= 2 and math.prod(self.counts) <= MAX_NODES
        problems = {
            f"needs 2 nodes or more along each axis, and at most {MAX_NODES} in all": not few,
            f"must be {SKIN_M} m thick or more; use a lighter, softer material instead": not (
                self.thickness >= SKIN_M
            ),
        }
        refuse(where, problems)
        flat = not self.sizes.min() > 1e-12
        refuse(where, {"needs a size: two of its nodes are in one place": flat})

    @property
    @abstractmethod
    def counts(self) -> Sequence[int]:
        """How many nodes there are along each of its axes."""

    @property
    @abstractmethod
    def nodes(self) -> Array:
        """The places of its nodes, in the order of `lattice`; computed once."""

    @cached_property
    def elements(self) -> Elements:
        """The numbers of each element's nodes; triangles face up, and tetrahedra have positive volumes."""
        found = simplices(self.counts)
        edges = self._measure_edges(found)
        dimensions = edges.shape[1]
        inverted = np.linalg.det(edges[..., :dimensions]) < 0
        found[inverted, 1:3] = found[inverted, 2:0:-1]

        return found

    @cached_property
    def sizes(self) -> Array:
        """The length, area or volume (E,) of each element: m, m^2 or m^3."""
        edges = self._measure_edges(self.elements)
        squares = np.linalg.det(edges @ edges.swapaxes(1, 2))

        return np.sqrt(np.maximum(squares, 0.0)) / math.factorial(edges.shape[1])

    def _measure_edges(self, elements: Elements) -> Array:
        """Measure the ways (E, D, 3) from the first node of each element to its others."""
        return self.nodes[elements[:, 1:]] - self.nodes[elements[:, :1]]

    @property
    def section(self) -> float:
        """What the sizes of elements are multiplied by for their volumes: 1, m or m^2."""
        return 1.0

    @property
    def volume(self) -> float:
        """The volume, m^3."""
        return self.section * float(self.sizes.sum())

    @cached_property
    def weights(self) -> Array:
        """The share (N,) of the mass that each node has."""
        corners = self.elements.shape[1]
        of_corner = self.sizes / self.sizes.sum() / corners
        shares = of_corner.repeat(corners)
        return np.bincount(self.elements.ravel(), shares).astype(np.float64)

    def surface(self, nodes: Array) -> Mesh:
        """Make the surface that is drawn: the faces of a solid.

        Args:
            nodes: (N, 3) where the nodes are. Whatever they are, the surface has the same faces.
        """
        from trimesh.grouping import group_rows  # takes long

        corners = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]
        faces = self.elements[:, corners].reshape(-1, 3)
        outer = group_rows(np.sort(faces, axis=1), require_count=1)

        return Mesh(nodes, faces[outer])


@dataclass(frozen=True)
class Rope(_Divided):
    """A rope. It bends as a rod of its thickness, and does not stretch.

    Attributes:
        path: points between which it is straight, metres.
        count: of its nodes, which are evenly spaced.
    """

    kind = "rope"
    most_young = 1e8
    path: tuple[Vector, ...]
    count: int = 20

    @property
    def counts(self) -> Sequence[int]:
        return (self.count,)

    @cached_property
    def nodes(self) -> Array:
        """The nodes along the path."""
        points = np.array(self.path, dtype=np.float64).reshape(-1, 3)
        pieces = step_lengths(points)
        ways = running_sums(pieces)
        evenly = np.linspace(0, ways[-1], self.count)
        axes = [np.interp(evenly, ways, axis) for axis in points.T]

        return frozen_array(np.stack(axes, axis=1))

    @property
    def section(self) -> float:
        return math.pi * self.thickness**2 / 4

    def surface(self, nodes: Array) -> Mesh:
        """Make a tube with closed ends."""
        from trimesh.creation import revolve  # takes long

        # A straight tube of radius 1 along z, on which a node is 1 from the next.
        numbers = np.arange(len(nodes))
        radii = np.pad(np.ones(len(nodes)), 1)
        heights = np.pad(numbers, 1, mode="edge")
        tube = revolve(np.column_stack([radii, heights]), sections=_CORNERS)
        x, y, z = tube.vertices.T[..., None]

        # Across the rope, away from the axis that it follows least.
        along = _unit(np.gradient(nodes, axis=0))
        aside = np.eye(3)[np.abs(along).max(axis=0).argmin()]
        across = _unit(np.cross(along, aside))
        up = np.cross(along, across)

        ring = np.rint(z[:, 0]).astype(int)
        off = x * across[ring] + y * up[ring]
        return Mesh(nodes[ring] + self.thickness / 2 * off, tube.faces)


@dataclass(frozen=True)
class Cloth(_Divided):
    """A flat sheet around the middle of its frame.

    Attributes:
        size: its sides along x and y, metres.
        counts: of the nodes along these sides.
    """

    kind = "cloth"
    most_young = 3e7
    size: tuple[float, float]
    counts: tuple[int, int] = (9, 9)

    @cached_property
    def nodes(self) -> Array:
        """The nodes, row by row."""
        long, wide = self.size
        return frozen_array(lattice(self.counts) * [long / 2, wide / 2, 0.0])

    @property
    def section(self) -> float:
        return self.thickness

    def surface(self, nodes: Array) -> Mesh:
        """Make both sides."""
        import trimesh  # takes long

        sheet = trimesh.Trimesh(nodes, self.elements, process=False)
        outward = sheet.vertex_normals * self.thickness / 2
        below = self.elements[:, ::-1] + len(nodes)

        return Mesh(
            np.concatenate([nodes + outward, nodes - outward]),
            np.concatenate([self.elements, below]),
        )


@dataclass(frozen=True)
class Filling(_Divided):
    """A soft solid that fills the convex hull of a shape.

    Attributes:
        shape: what it fills.
        counts: of the nodes along x, y and z.
    """

    kind = "solid"
    most_young = 3e5
    shape: Shape
    counts: tuple[int, int, int] = (3, 3, 3)

    @cached_property
    def nodes(self) -> Array:
        """The nodes, evenly placed, the outer ones on the surface."""
        hull = self.shape.to_trimesh().convex_hull
        unit = lattice(self.counts)
        middle = hull.bounds.mean(axis=0)
        ways = unit * np.ptp(hull.bounds, axis=0) / 2
        out = np.abs(unit).max(axis=1, keepdims=True)  # 1: on the surface
        away = out > 0

        # How far the surface is along each way, by the faces of the hull.
        toward = ways / np.where(away, out, 1.0) @ hull.face_normals.T
        far = ((hull.triangles[:, 0] - middle) * hull.face_normals).sum(axis=1)
        never = np.full_like(toward, np.inf)
        reach = np.divide(far, toward, out=never, where=toward > 1e-9)
        nearest = reach.min(axis=1, keepdims=True)

        return frozen_array(middle + ways * np.where(away, nearest, 0.0))


Form = Rope | Cloth | Filling


def lattice(counts: Sequence[int]) -> Array:
    """Place nodes evenly in the cube from -1 to 1, or in a square or line of it.

    Args:
        counts: of the nodes along one to three axes.

    Returns:
        Places (N, 3), the last axis fastest.
    """
    counts = _three(counts)
    ends = [min(count - 1, 1) for count in counts]
    axes = [np.linspace(-end, end, n) for end, n in zip(ends, counts, strict=True)]
    places = np.meshgrid(*axes, indexing="ij")

    return np.stack(places, axis=-1).reshape(-1, 3)


def simplices(counts: Sequence[int]) -> Elements:
    """Divide the cells of a `lattice` into segments, triangles or tetrahedra.

    A cube has six tetrahedra, one for each order in which the axes can be walked from a corner to the opposite one.

    Args:
        counts: of the nodes along one to three axes.

    Returns:
        The numbers (E, D + 1) of the nodes of each.
    """
    counts = _three(counts)
    numbers = np.arange(math.prod(counts)).reshape(counts)
    cells = np.argwhere(np.ones([max(count - 1, 1) for count in counts]))
    mirrored = cells % 2  # every second cell, so that both sides of a body are alike
    found = []

    for axes in permutations([axis for axis, count in enumerate(counts) if count > 1]):
        corner = cells + mirrored
        element = [numbers[tuple(corner.T)]]

        for axis in axes:
            corner[:, axis] += 1 - 2 * mirrored[:, axis]
            element.append(numbers[tuple(corner.T)])

        found.append(np.stack(element, axis=-1))

    return np.concatenate(found)


def _three(counts: Sequence[int]) -> tuple[int, ...]:
    """Count the nodes along all three axes."""
    return (*counts, 1, 1)[:3]


def _unit(vectors: Array) -> Array:
    """Give vectors (N, 3) the length 1.

    Those without a length stay as they are.
    """
    lengths: Array = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.maximum(lengths, 1e-12)

"""Define what every shape says of itself, and shapes of triangles."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from core.shapes.poses import Array, Pose, Vector, frozen_array
from core.support.text import short_numbers

if TYPE_CHECKING:  # slow to import, and not needed to name shapes
    import trimesh

Part = tuple[
    "Shape", Pose | None
]  # and where it is in the frame of the whole; None: there
Move = Callable[[Array], Array]  # of points (N, 3)


class Integrals(NamedTuple):
    """The integrals over a solid of one density.

    Attributes:
        volume: m^3.
        center: (3,) of mass.
        tensor: (3, 3) of inertia about it, for 1 kg.
    """

    volume: float
    center: Array
    tensor: Array


class Shape(ABC):
    """A solid in its own frame, metres. Who needs to know something of a shape asks it, and looks at no type.

    A kind gives its triangles, and its convex parts if it is not convex. All else follows from these; a kind overrides
    what it knows exactly.

    Attributes:
        kind: what people, designs and scene files call it.
        ending: of the word for several.
        is_convex: whether it collides as it is.
        is_round: whether it looks the same however it turns about its z.
        is_hull: whether engines take its corners alone; PyBullet makes such a hull thicker by a margin.
    """

    kind: ClassVar[str]
    ending: ClassVar[str] = "s"
    is_convex: ClassVar[bool] = True
    is_round: ClassVar[bool] = False
    is_hull: ClassVar[bool] = True

    @abstractmethod
    def to_trimesh(self) -> trimesh.Trimesh:
        """Return its triangles; what is round gets corners."""

    @property
    def triangles(self) -> Mesh:
        """Its triangles."""
        return _keep_triangles(self)

    def hull(self) -> trimesh.Trimesh:
        """Return the triangles that collide, of a convex shape."""
        return self.to_trimesh()

    def convex_parts(self) -> tuple[Shape, ...]:
        """Return the convex shapes that collide in its place, in its frame."""
        return (self,)

    def urdf_parts(self) -> tuple[Part, ...]:
        """Return what it is in a URDF: shapes that URDF has, or meshes."""
        return ((self.triangles, None),)

    def coal(self) -> Any:
        """Return it as a geometry of Coal; a convex one."""
        return convex_hull(self.triangles.vertices)

    @property
    def volume(self) -> float:
        """The volume, m^3."""
        return self.triangles.integrals.volume

    @property
    def area(self) -> float:
        """The area of the surface, m^2."""
        return float(self.to_trimesh().area)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """The middle (3,) of the bounding box along the shape's own axes, and its full side lengths (3,)."""
        corners = self.triangles.vertices
        low = corners.min(axis=0)
        high = corners.max(axis=0)

        return (low + high) / 2, high - low

    @property
    def corners(self) -> Array:
        """Those (8, 3) of the bounding box along the shape's own axes."""
        middle, size = self.bounds
        return box_corners(middle - size / 2, middle + size / 2)

    @property
    def thickness(self) -> float:
        """How thick it is along its own axes, or square to a face of it, metres."""
        return float(self.bounds[1].min())

    @property
    def ball_radius(self) -> float:
        """Its radius, if it is a ball, which looks the same however it turns; else infinite."""
        return np.inf

    @property
    def is_ball(self) -> bool:
        return self.ball_radius < np.inf

    def volume_inside(self, wall: float) -> float:
        """Compute the volume within a wall all around, m^3.

        Args:
            wall: its thickness, metres.
        """
        return max(0.0, self.volume - wall * self.area)

    def extent(self, direction: Array) -> float:
        """Measure how far it reaches from its origin in a direction (3,) of length 1, metres."""
        return float((self.triangles.vertices @ direction).max())

    def inertia(self, mass: float) -> tuple[Array, Array]:
        """Compute where the mass of a solid of one density is, kg.

        Returns:
            The centre of mass (3,), metres, and the inertia tensor (3, 3) about it, kg m^2.
        """
        integrals = self.triangles.integrals
        return integrals.center, mass * integrals.tensor

    def resized(self, size: Vector) -> Shape:
        """Return it stretched to another bounding box; what is round stays so, with means of two or three sides.

        Args:
            size: the side lengths (3,) of the new box, metres.
        """
        middle, before = self.bounds
        factors = np.asarray(size) / before

        return self.moved(lambda points: (points - middle) * factors + middle)

    def scaled(self, factor: float) -> Shape:
        """Return it with all lengths multiplied, about its frame."""
        return self.moved(lambda points: factor * points)

    def moved(self, move: Move) -> Shape:
        """Return a shape of triangles, with all corners moved; it must stay convex where it was."""
        surface = self.triangles.moved(move)
        if self.is_convex:
            return surface

        parts = [part.triangles.moved(move) for part in self.convex_parts()]
        return Compound(surface, tuple(parts))

    @classmethod
    def count(cls, number: int) -> str:
        """Say how many there are, such as ``3 boxes``."""
        ending = "" if number == 1 else cls.ending
        return f"{number} {cls.kind}{ending}"

    def describe(self) -> str:
        """Name it with its sizes in metres."""
        return f"{self.kind}, {short_numbers(self.bounds[1], 3)}"


@dataclass(frozen=True, eq=False)
class Mesh(Shape):
    """Triangles. As a collision shape they mean their convex hull.

    Attributes:
        vertices: (V, 3) metres.
        faces: (F, 3) of vertex numbers, counterclockwise as seen from outside.

    Raises:
        ValueError: wrong shapes, numbers that are not finite, or a face of a vertex that is not there.
    """

    kind = "convex part"

    vertices: Array
    faces: npt.NDArray[np.int64]

    def __post_init__(self) -> None:
        vertices = frozen_array(self.vertices)
        faces = np.array(self.faces, dtype=np.int64)
        missing = (faces < 0) | (faces >= len(vertices))
        if vertices.shape[1:] != (3,) or faces.shape[1:] != (3,) or missing.any():
            raise ValueError(
                f"expected vertices (V, 3) and faces (F, 3) of their numbers, got {vertices.shape} and {faces.shape}"
            )

        faces.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    @cached_property
    def content(self) -> str:
        """A hash: meshes with the same one are equal."""
        return hashlib.blake2b(
            self.vertices.tobytes() + self.faces.tobytes(), digest_size=16
        ).hexdigest()

    @cached_property
    def integrals(self) -> Integrals:
        """Those over what the mesh encloses."""
        solid = self.to_trimesh()
        volume = float(solid.volume)
        tensor = frozen_array(solid.moment_inertia / volume)

        return Integrals(volume, frozen_array(solid.center_mass), tensor)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Mesh) and self.content == other.content

    def __hash__(self) -> int:
        return hash(self.content)

    @classmethod
    def from_trimesh(cls, mesh: trimesh.Trimesh) -> Mesh:
        """Copy the triangles of a Trimesh."""
        return cls(np.asarray(mesh.vertices), np.asarray(mesh.faces))

    @classmethod
    def hull_of(cls, points: npt.ArrayLike) -> Mesh:
        """Make the convex hull of points (N, 3)."""
        import trimesh

        return cls.from_trimesh(trimesh.convex.convex_hull(points))

    def to_trimesh(self) -> trimesh.Trimesh:
        """Return its triangles."""
        import trimesh

        return trimesh.Trimesh(self.vertices, self.faces, process=False)

    @property
    def triangles(self) -> Mesh:
        """Itself."""
        return self

    def hull(self) -> trimesh.Trimesh:
        """Return the triangles of its convex hull."""
        return self.to_trimesh().convex_hull

    @property
    def thickness(self) -> float:
        """How thick its hull is along its own axes, or square to a face, metres."""
        return _measure_thickness(self)

    def moved(self, move: Move) -> Mesh:
        """Return it with all corners moved."""
        return Mesh(move(self.vertices), self.faces)

    def describe(self) -> str:
        """Name it with its corners and sizes."""
        size = short_numbers(self.bounds[1], 3)
        return f"{self.kind} of {len(self.vertices)} corners, {size}"


@dataclass(frozen=True)
class Compound(Shape):
    """A solid that need not be convex.

    Attributes:
        surface: its closed surface, which is drawn and weighed.
        parts: the convex meshes that collide in its place.
    """

    kind = "solid"
    is_convex = False

    surface: Mesh
    parts: tuple[Mesh, ...]

    def to_trimesh(self) -> trimesh.Trimesh:
        """Return the triangles of its surface."""
        return self.surface.to_trimesh()

    @property
    def triangles(self) -> Mesh:
        """Its surface."""
        return self.surface

    def convex_parts(self) -> tuple[Shape, ...]:
        """Return its parts."""
        return self.parts


# Equal meshes and shapes are made anew for each rollout.
@lru_cache(maxsize=256)
def _keep_triangles(shape: Shape) -> Mesh:
    """Return the triangles of a shape."""
    return Mesh.from_trimesh(shape.to_trimesh())


@lru_cache(maxsize=512)
def _measure_thickness(mesh: Mesh) -> float:
    """Measure how thick the hull of a mesh is, metres; see `Mesh.thickness`."""
    straight = float(mesh.bounds[1].min())
    convex = mesh.hull()
    across = np.ptp(convex.vertices @ convex.face_normals.T, axis=0)

    return min(straight, float(across.min()))


def box_corners(low: Array, high: Array) -> Array:
    """Return the corners (8, 3) of a box along the axes, around its bottom and then around its top."""
    import trimesh

    return np.asarray(trimesh.bounds.corners([low, high]))


def convex_hull(corners: Array) -> Any:
    """Build the convex hull of points (V, 3) as a geometry of Coal."""
    import coal
    import trimesh

    hull = trimesh.convex.convex_hull(corners)
    points = coal.StdVec_Vec3s()
    points.extend(hull.vertices)
    faces = coal.StdVec_Triangle()
    faces.extend(coal.Triangle(*face) for face in hull.faces.tolist())
    return coal.Convex(points, faces)

"""Shapes of a few lengths: boxes and round ones. All are centred on their frames."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from core.shapes.poses import Array, Pose, Triple, Vector
from core.shapes.solid import Part, Shape
from core.support.text import short_number, short_numbers

if TYPE_CHECKING:
    import trimesh


class Primitive(Shape):
    """A shape whose fields are lengths, metres. Designs and scene files name it.

    Attributes:
        wording: how a model writes its lengths, and where it lies.
        means: what it is, in the format of scene files and on the page of the types of a scene.
        in_urdf: whether URDF has it, by the same names.

    Raises:
        ValueError: a length is not positive.
    """

    wording: ClassVar[str]
    means: ClassVar[str]
    in_urdf: ClassVar[bool] = False

    def __post_init__(self) -> None:
        self._check_lengths(vars(self))

    def _check_lengths(self, lengths: Mapping[str, float]) -> None:
        for name, value in lengths.items():
            if not 0 < value < math.inf:
                raise ValueError(
                    f"{self.kind}: {name} must be a positive length in metres, got {value}"
                )

    @classmethod
    def lengths(cls) -> dict[str, int]:
        """Return the names of its fields, each with how many numbers it holds."""
        return {field.name: 1 for field in fields(cls)}  # type: ignore[arg-type]

    @classmethod
    def of(cls, *numbers: float) -> Self:
        """Make one of all its numbers."""
        return cls(*numbers)

    @property
    def sizes(self) -> dict[str, Any]:
        """Its fields: a number each, or several."""
        return {name: getattr(self, name) for name in self.lengths()}

    @property
    def numbers(self) -> tuple[float, ...]:
        """All its numbers."""
        return tuple(self.sizes.values())

    def urdf_parts(self) -> tuple[Part, ...]:
        """Return itself, if URDF has it."""
        if self.in_urdf:
            return ((self, None),)

        return super().urdf_parts()

    def scaled(self, factor: float) -> Self:
        """Return it with all lengths multiplied."""
        return self.of(*(factor * number for number in self.numbers))

    def describe(self) -> str:
        """Name it with its lengths."""
        lengths = zip(self.lengths(), self.numbers, strict=True)
        words = [f"{name} {short_number(value, 3)}" for name, value in lengths]

        return ", ".join((self.kind, *words))


class Centered(Primitive):
    """One with its middle in its frame's origin, and the frame's axes as principal ones."""

    @property
    @abstractmethod
    def sides(self) -> Triple:
        """Those of its bounding box, metres."""

    @abstractmethod
    def moments(self, mass: float) -> Sequence[float] | Array:
        """Compute the moments of inertia (3,) about its axes, kg m^2, for a mass in kg."""

    @property
    def bounds(self) -> tuple[Array, Array]:
        return np.zeros(3), np.array(self.sides)

    def inertia(self, mass: float) -> tuple[Array, Array]:
        return np.zeros(3), np.diag(self.moments(mass))


class _Native(Centered):
    """One that every engine has."""

    is_hull = False


@dataclass(frozen=True)
class Box(_Native):
    """A box centred on its frame.

    Attributes:
        size: its full side lengths along x, y and z, metres.

    Raises:
        ValueError: one of them is not positive.
    """

    kind = "box"
    ending = "es"
    in_urdf = True
    wording = " with `size` [x, y, z], full side lengths along its own axes"
    means = "Full side lengths along x, y and z, m"

    size: Triple

    def __post_init__(self) -> None:
        size = tuple(map(float, self.size))

        self._check_lengths(dict(zip("xyz", size, strict=True)))
        object.__setattr__(self, "size", size)

    @classmethod
    def lengths(cls) -> dict[str, int]:
        return {"size": 3}

    @classmethod
    def of(cls, *numbers: float) -> Self:
        return cls(numbers)

    @property
    def numbers(self) -> tuple[float, ...]:
        return self.size

    @property
    def volume(self) -> float:
        return float(np.prod(self.size))

    @property
    def area(self) -> float:
        x, y, z = self.size
        return 2 * (x * y + y * z + z * x)

    @property
    def sides(self) -> Triple:
        return self.size

    def to_trimesh(self) -> trimesh.Trimesh:
        import trimesh

        return trimesh.creation.box(self.size)

    def coal(self) -> Any:
        import coal

        return coal.Box(*self.size)

    def volume_inside(self, wall: float) -> float:
        return math.prod(max(0.0, side - 2 * wall) for side in self.size)

    def moments(self, mass: float) -> Array:
        x, y, z = np.square(self.size)
        return mass / 12 * np.array([y + z, x + z, x + y])

    def resized(self, size: Vector) -> Box:
        return Box(tuple(size))

    def describe(self) -> str:
        return f"{self.kind} {short_numbers(self.size, 3)}"


@dataclass(frozen=True)
class Sphere(_Native):
    """A sphere centred on its frame."""

    kind = "sphere"
    in_urdf = True
    wording = " with `radius`"
    means = "Its radius, m"
    is_round = True

    radius: float

    @property
    def volume(self) -> float:
        return 4 / 3 * math.pi * self.radius**3

    @property
    def area(self) -> float:
        return 4 * math.pi * self.radius**2

    @property
    def sides(self) -> Triple:
        return (2 * self.radius,) * 3

    @property
    def ball_radius(self) -> float:
        return self.radius

    def to_trimesh(self) -> trimesh.Trimesh:
        import trimesh

        return trimesh.creation.icosphere(subdivisions=3, radius=self.radius)

    def coal(self) -> Any:
        import coal

        # Coal's formula for a sphere in a cylinder goes out sideways, however
        # near the end is. A capsule without a length takes the general way.
        return coal.Capsule(self.radius, 0.0)

    def extent(self, direction: Array) -> float:
        return self.radius

    def moments(self, mass: float) -> Sequence[float]:
        return [2 / 5 * mass * self.radius**2] * 3

    def resized(self, size: Vector) -> Sphere:
        x, y, z = map(float, size)
        return Sphere((x + y + z) / 6)


@dataclass(frozen=True)
class Cylinder(_Native):
    """A cylinder along z, centred on its frame."""

    kind = "cylinder"
    in_urdf = True
    wording = " with `radius` and `length`, along its own z"
    means = "A cylinder along its z"
    is_round = True

    radius: float
    length: float

    @property
    def volume(self) -> float:
        return math.pi * self.radius**2 * self.length

    @property
    def area(self) -> float:
        return 2 * math.pi * self.radius * (self.radius + self.length)

    @property
    def sides(self) -> Triple:
        across = 2 * self.radius
        return across, across, self.length

    def to_trimesh(self) -> trimesh.Trimesh:
        import trimesh

        return trimesh.creation.cylinder(
            radius=self.radius, height=self.length, sections=48
        )

    def coal(self) -> Any:
        import coal

        return coal.Cylinder(self.radius, self.length)

    def extent(self, direction: Array) -> float:
        x, y, z = map(float, direction)
        return self.radius * math.hypot(x, y) + self.length / 2 * abs(z)

    def moments(self, mass: float) -> Sequence[float]:
        across = mass * (3 * self.radius**2 + self.length**2) / 12
        return across, across, mass * self.radius**2 / 2

    def resized(self, size: Vector) -> Cylinder:
        x, y, z = map(float, size)
        return Cylinder((x + y) / 4, z)


@dataclass(frozen=True)
class Capsule(_Native):
    """A cylinder along z, centred on its frame, with half a sphere on each end; ``length`` is without these."""

    kind = "capsule"
    wording = (
        ", the same with half a sphere added at each end, which `length` leaves out"
    )
    means = "A cylinder along its z with half a sphere at each end"
    is_round = True

    radius: float
    length: float

    @property
    def volume(self) -> float:
        return math.pi * self.radius**2 * (self.length + 4 / 3 * self.radius)

    @property
    def area(self) -> float:
        return 2 * math.pi * self.radius * (self.length + 2 * self.radius)

    @property
    def sides(self) -> Triple:
        across = 2 * self.radius
        return across, across, self.length + across

    def to_trimesh(self) -> trimesh.Trimesh:
        import trimesh

        mesh = trimesh.creation.capsule(
            height=self.length, radius=self.radius, count=(32, 32)
        )
        return mesh.apply_translation(-mesh.bounds.mean(axis=0))

    def urdf_parts(self) -> tuple[Part, ...]:
        """Return a cylinder with a ball at each end, since URDF has no capsules."""
        parts: list[Part] = [(Cylinder(self.radius, self.length), None)]
        for end in (-self.length / 2, self.length / 2):
            parts.append((Sphere(self.radius), Pose(np.array([0.0, 0.0, end]))))

        return tuple(parts)

    def coal(self) -> Any:
        import coal

        return coal.Capsule(self.radius, self.length)

    def extent(self, direction: Array) -> float:
        return self.radius + self.length / 2 * abs(float(direction[2]))

    def moments(self, mass: float) -> Sequence[float]:
        radius = self.radius
        length = self.length
        caps = mass * 4 * radius / (4 * radius + 3 * length)
        rod = mass - caps
        along = rod * radius**2 / 2 + caps * 2 / 5 * radius**2
        across = rod * (3 * radius**2 + length**2) / 12
        across += caps * (2 / 5 * radius**2 + length**2 / 4 + 3 / 8 * radius * length)

        return across, across, along

    def resized(self, size: Vector) -> Capsule:
        x, y, z = map(float, size)
        return Capsule((x + y) / 4, max(z - (x + y) / 2, 1e-6))

    def describe(self) -> str:
        return f"{super().describe()} without its ends"

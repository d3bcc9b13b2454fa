"""Poses and shapes as small immutable values.

Lengths are metres, angles radians, quaternions (w, x, y, z). Roll, pitch and yaw are rotations about the fixed x, y and
z axes, in that order, as in URDF: ``R = Rz(yaw) @ Ry(pitch) @ Rx(roll)``.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:  # both are slow to import, and not needed to name poses and shapes
    import trimesh
    from scipy.spatial.transform import Rotation

Array = npt.NDArray[np.float64]
Vector = Sequence[float] | Array
Triple = tuple[float, ...]  # x, y and z
Color = tuple[float, ...]  # red, green, blue and opacity, 0..1


def frozen_array(values: npt.ArrayLike, shape: tuple[int, ...] | None = None) -> Array:
    """Copy values to a read-only float64 array.

    Args:
        values: numbers.
        shape: what their shape must be; None: any.

    Raises:
        ValueError: the shape is not ``shape``, or a number is not finite.
    """
    array = np.array(values, dtype=np.float64)
    if shape is not None and array.shape != shape:
        raise ValueError(f"expected an array of shape {shape}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError("expected finite numbers")

    array.setflags(write=False)
    return array


def step_lengths(points: Array) -> Array:
    """Measure how far each of some points (..., N, 3) is from the one before: (..., N - 1)."""
    steps: Array = np.linalg.norm(np.diff(points, axis=-2), axis=-1)
    return steps


def running_sums(values: Array) -> Array:
    """Sum up the first 0, 1, ... of values (N,): (N + 1,)."""
    sums = np.zeros(len(values) + 1)
    np.add.accumulate(values, out=sums[1:])
    return sums


# Single rotations, in plain numbers. SciPy's `Rotation` is made for many at once, and takes ten times as long for one.
# Every step rounds as SciPy's does, so that results are equal to the bit.

Quaternion = tuple[float, float, float, float]  # w, x, y and z
_LOCKED_RAD = 1e-7  # nearer to a pitch of 90 degrees roll and yaw are one


def _normalise(w: float, x: float, y: float, z: float) -> Quaternion:
    """Make a quaternion's length 1."""
    length = math.sqrt(x * x + y * y + z * z + w * w)
    return w / length, x / length, y / length, z / length


def _multiply(first: Quaternion, second: Quaternion) -> Quaternion:
    """Multiply two quaternions: the second turn comes first."""
    w, x, y, z = first
    v, a, b, c = second

    return (
        w * v - x * a - y * b - z * c,
        w * a + v * x + (y * c - z * b),
        w * b + v * y + (z * a - x * c),
        w * c + v * z + (x * b - y * a),
    )


def _turn_by_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """Make a quaternion (4,) of fixed-axis roll, pitch and yaw, radians.

    Raises:
        ValueError: an angle is not finite.
    """
    if not math.isfinite(roll + pitch + yaw):
        raise ValueError("expected finite numbers")

    about_x = (math.cos(roll / 2), math.sin(roll / 2), 0.0, 0.0)
    about_y = (math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0)
    about_z = (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2))

    return np.array(_multiply(about_z, _multiply(about_y, about_x)))


def _rpy_of(w: float, x: float, y: float, z: float) -> Array:
    """Find the fixed-axis roll, pitch and yaw (3,) of a unit quaternion, radians; see `Pose.rpy`.

    The method is that of E. Bernardes and S. Viollet, "Quaternion to Euler angles conversion", PLoS ONE 17(11), 2022.
    """
    a = w - y
    b = x + z
    c = y + w
    d = z - x

    # `math.hypot` rounds otherwise than the C library's.
    double_tilt = 2 * math.atan2(np.hypot(c, d), np.hypot(a, b))
    half_sum = math.atan2(b, a)
    half_difference = math.atan2(d, c)

    if double_tilt <= _LOCKED_RAD:
        roll = 2 * half_sum
        yaw = 0.0
    elif abs(double_tilt - math.pi) <= _LOCKED_RAD:
        roll = -2 * half_difference
        yaw = 0.0
    else:
        roll = half_sum - half_difference
        yaw = half_sum + half_difference

    angles = (roll, double_tilt - math.pi / 2, yaw)
    return np.array([_wrap_once(angle) for angle in angles])


def _wrap_once(angle: float) -> float:
    """Bring an angle of less than a turn and a half to -pi to pi."""
    if angle < -math.pi:
        return angle + 2 * math.pi
    if angle > math.pi:
        return angle - 2 * math.pi
    return angle


def _turn_matrix(w: float, x: float, y: float, z: float) -> Array:
    """Make the matrix (3, 3) of a unit quaternion; it is read-only."""
    xx = x * x
    yy = y * y
    zz = z * z
    ww = w * w

    xy = x * y
    xz = x * z
    yz = y * z
    xw = x * w
    yw = y * w
    zw = z * w

    matrix = np.array(
        [
            [xx - yy - zz + ww, 2 * (xy - zw), 2 * (xz + yw)],
            [2 * (xy + zw), -xx + yy - zz + ww, 2 * (yz - xw)],
            [2 * (xz - yw), 2 * (yz + xw), -xx - yy + zz + ww],
        ]
    )
    matrix.setflags(write=False)
    return matrix


@dataclass(frozen=True, eq=False)
class Pose:
    """Where one frame is in another. Poses are compared and hashed by their numbers.

    As in ``Pose.xyz_rpy((0, 0, 0.1)) @ part.pose``.

    Attributes:
        position: (3,) metres.
        quaternion: (4,), (w, x, y, z); any length but zero is made 1.

    Raises:
        ValueError: wrong shapes, numbers that are not finite, or a quaternion of length zero.
    """

    position: Array = field(default_factory=lambda: np.zeros(3))
    quaternion: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))

    def __post_init__(self) -> None:
        quaternion = np.array(self.quaternion, dtype=np.float64)
        length = math.sqrt(np.vdot(quaternion, quaternion))
        if length < 1e-9:
            raise ValueError("a quaternion of length zero is no orientation")

        object.__setattr__(self, "position", frozen_array(self.position, (3,)))
        object.__setattr__(self, "quaternion", frozen_array(quaternion / length, (4,)))

    @classmethod
    def xyz_rpy(cls, xyz: Vector, rpy: Vector = (0.0, 0.0, 0.0)) -> Pose:
        """Make a pose.

        Args:
            xyz: the position, metres.
            rpy: fixed-axis roll, pitch, yaw, radians.
        """
        roll, pitch, yaw = map(float, rpy)
        return cls(np.asarray(xyz), _turn_by_rpy(roll, pitch, yaw))

    @classmethod
    def from_rotation(cls, position: Vector, rotation: Rotation) -> Pose:
        """Make a pose from a position (3,) and a rotation."""
        return cls(np.asarray(position), rotation.as_quat(scalar_first=True))

    @classmethod
    def from_matrix(cls, matrix: Array) -> Pose:
        """Make a pose from a homogeneous (4, 4) matrix."""
        from scipy.spatial.transform import Rotation

        return cls.from_rotation(matrix[:3, 3], Rotation.from_matrix(matrix[:3, :3]))

    @cached_property
    def rotation(self) -> Rotation:
        """The orientation as SciPy has it."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(self.quaternion, scalar_first=True)

    @cached_property
    def _unit(self) -> Quaternion:
        """The orientation (w, x, y, z), as `rotation` has it."""
        return _normalise(*self.quaternion.tolist())

    @cached_property
    def rotation_matrix(self) -> Array:
        """The orientation as a matrix (3, 3), read-only."""
        return _turn_matrix(*self._unit)

    def __getstate__(self) -> dict[str, Array]:
        # Not what is cached.
        return {"position": self.position, "quaternion": self.quaternion}

    @property
    def rpy(self) -> Array:
        """Fixed-axis roll, pitch, yaw (3,). At a pitch of 90 degrees they are not unique; there yaw is 0."""
        return _rpy_of(*self._unit)

    @property
    def matrix(self) -> Array:
        """The homogeneous (4, 4) matrix."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation_matrix
        matrix[:3, 3] = self.position

        return matrix

    def __matmul__(self, other: Pose) -> Pose:
        """Compose poses: ``a @ b`` is the pose of b's frame where a is given, if b is given in a's frame."""
        turned = _normalise(*_multiply(self._unit, other._unit))
        return Pose(self.apply(other.position), np.array(turned))

    def inverse(self) -> Pose:
        """The pose of the frame that this one is given in, in this frame."""
        w, x, y, z = self._unit
        back = (w, -x, -y, -z)
        return Pose(-(_turn_matrix(*back) @ self.position), np.array(back))

    def apply(self, points: npt.ArrayLike) -> Array:
        """Transform points (..., 3) from this pose's frame to the frame that the pose is given in."""
        points = np.asarray(points, dtype=np.float64)
        return points @ self.rotation_matrix.T + self.position

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Pose)
            # An eighth of the time of comparing arrays.
            and self.position.tolist() == other.position.tolist()
            and self.quaternion.tolist() == other.quaternion.tolist()
        )

    def __hash__(self) -> int:
        return hash((self.position.tobytes(), self.quaternion.tobytes()))


def _check_lengths(shape: _Solid, **lengths: float) -> None:
    """Refuse lengths of a shape that are not positive numbers, by their names."""
    kind = type(shape).__name__.lower()
    for name, value in lengths.items():
        if not 0 < value < math.inf:
            raise ValueError(
                f"{kind}: {name} must be a positive length in metres, got {value}"
            )


class _Solid:
    """What all shapes can say of themselves, in their own frames.

    Round ones are exact but in `to_trimesh`. A `Mesh` answers for itself, a `Compound` for its surface.
    """

    @property
    def volume(self) -> float:
        """The volume, m^3."""
        match self:
            case Box(size):
                return float(np.prod(size))
            case Sphere(radius):
                return 4 / 3 * math.pi * radius**3
            case Cylinder(radius, length):
                return math.pi * radius**2 * length
            case Capsule(radius, length):
                return math.pi * radius**2 * (length + 4 / 3 * radius)

        return cast("Mesh", self.drawn).integrals.volume

    @property
    def area(self) -> float:
        """The area of the surface, m^2."""
        match self:
            case Box((x, y, z)):
                return 2 * (x * y + y * z + z * x)
            case Sphere(radius):
                return 4 * math.pi * radius**2
            case Cylinder(radius, length):
                return 2 * math.pi * radius * (radius + length)
            case Capsule(radius, length):
                return 2 * math.pi * radius * (length + 2 * radius)

        return float(self.to_trimesh().area)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """The middle (3,) of the bounding box along the shape's own axes, and its full side lengths (3,)."""
        sides: Vector

        match self:
            case Box(size):
                sides = size
            case Sphere(radius):
                sides = [2 * radius] * 3
            case Cylinder(radius, length):
                sides = [2 * radius, 2 * radius, length]
            case Capsule(radius, length):
                sides = [2 * radius, 2 * radius, length + 2 * radius]
            case _:
                corners = cast("Mesh", self.drawn).vertices
                low = corners.min(axis=0)
                high = corners.max(axis=0)
                return (low + high) / 2, high - low

        return np.zeros(3), np.array(sides)

    def to_trimesh(self) -> trimesh.Trimesh:
        """Return its triangles; what is round gets corners."""
        import trimesh

        match self:
            case Box(size):
                return trimesh.creation.box(size)
            case Sphere(radius):
                return trimesh.creation.icosphere(subdivisions=3, radius=radius)
            case Cylinder(radius, length):
                return trimesh.creation.cylinder(
                    radius=radius, height=length, sections=48
                )
            case Capsule(radius, length):
                mesh = trimesh.creation.capsule(
                    height=length, radius=radius, count=(32, 32)
                )
                return mesh.apply_translation(-mesh.bounds.mean(axis=0))

        mesh = cast("Mesh", self.drawn)

        return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)

    def convex_parts(self) -> tuple[Shape, ...]:
        """Return the convex shapes that collide in its place."""
        return (cast("Shape", self),)

    @property
    def drawn(self) -> Shape:
        """The shape that is drawn; of a `Mesh` all triangles, not its hull."""
        return cast("Shape", self)


@dataclass(frozen=True)
class Box(_Solid):
    """A box centred on its frame.

    Attributes:
        size: its full side lengths along x, y and z, metres.

    Raises:
        ValueError: one of them is not positive.
    """

    size: Triple

    def __post_init__(self) -> None:
        size = tuple(map(float, self.size))

        _check_lengths(self, **dict(zip("xyz", size, strict=True)))
        object.__setattr__(self, "size", size)


class _Round(_Solid):
    """A shape whose fields are lengths, metres.

    Raises:
        ValueError: one of them is not positive.
    """

    def __post_init__(self) -> None:
        _check_lengths(self, **vars(self))


@dataclass(frozen=True)
class Sphere(_Round):
    """A sphere centred on its frame."""

    radius: float


@dataclass(frozen=True)
class Cylinder(_Round):
    """A cylinder along z, centred on its frame."""

    radius: float
    length: float


@dataclass(frozen=True)
class Capsule(_Round):
    """A cylinder along z, centred on its frame, with half a sphere on each end; ``length`` is without these."""

    radius: float
    length: float


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


@dataclass(frozen=True, eq=False)
class Mesh(_Solid):
    """Triangles. As a collision shape they mean their convex hull.

    Attributes:
        vertices: (V, 3) metres.
        faces: (F, 3) of vertex numbers, counterclockwise as seen from outside.

    Raises:
        ValueError: wrong shapes, numbers that are not finite, or a face of a vertex that is not there.
    """

    vertices: Array
    faces: npt.NDArray[np.int64]

    def __post_init__(self) -> None:
        vertices = frozen_array(self.vertices)
        faces = np.array(self.faces, dtype=np.int64)
        if vertices.shape[1:] != (3,) or faces.shape[1:] != (3,):
            raise ValueError(
                f"expected vertices (V, 3) and faces (F, 3), got {vertices.shape} and {faces.shape}"
            )

        if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
            raise ValueError(
                f"faces: vertex numbers must be 0 to {len(vertices) - 1}, got {faces.min()} to {faces.max()}"
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


@dataclass(frozen=True)
class Compound(_Solid):
    """A solid that need not be convex.

    Attributes:
        surface: its closed surface, which is drawn and weighed.
        parts: the convex meshes that collide in its place.
    """

    surface: Mesh
    parts: tuple[Mesh, ...]

    def convex_parts(self) -> tuple[Shape, ...]:
        """Return the convex shapes that collide in its place."""
        return self.parts

    @property
    def drawn(self) -> Shape:
        """The shape that is drawn."""
        return self.surface


Shape = Box | Sphere | Cylinder | Capsule | Mesh  # convex ones


def mass_properties(shape: Shape | Compound, mass: float) -> tuple[Array, Array]:
    """Compute where the mass of a solid of one density is.

    Formulas are those of a handbook; of meshes the integrals over the volume are taken.

    Args:
        shape: of the solid.
        mass: in all, kg.

    Returns:
        The centre of mass (3,), metres, and the inertia tensor (3, 3) about it, kg m^2.
    """
    match shape:
        case Box(size):
            x, y, z = np.square(size)
            moments = mass / 12 * np.array([y + z, x + z, x + y])
        case Sphere(radius):
            moments = 2 / 5 * mass * radius**2 * np.ones(3)
        case Cylinder(radius, length):
            across = mass * (3 * radius**2 + length**2) / 12
            moments = np.array([across, across, mass * radius**2 / 2])
        case Capsule(radius, length):
            caps = mass * 4 * radius / (4 * radius + 3 * length)
            rod = mass - caps
            along = rod * radius**2 / 2 + caps * 2 / 5 * radius**2
            across = rod * (3 * radius**2 + length**2) / 12
            across += caps * (
                2 / 5 * radius**2 + length**2 / 4 + 3 / 8 * radius * length
            )
            moments = np.array([across, across, along])
        case _:
            integrals = cast("Mesh", shape.drawn).integrals
            return integrals.center, mass * integrals.tensor

    return np.zeros(3), np.diag(moments)


def resized(shape: Shape | Compound, size: Vector) -> Shape | Compound:
    """Return a shape of the same kind with another bounding box.

    Args:
        shape: what is stretched.
        size: the side lengths (3,) of the new box, metres. Radii are means of two or three of them.
    """
    x, y, z = map(float, size)

    middle, before = shape.bounds

    def stretch(mesh: Mesh) -> Mesh:
        return Mesh((mesh.vertices - middle) * (size / before) + middle, mesh.faces)

    match shape:
        case Box():
            return Box((x, y, z))
        case Sphere():
            return Sphere((x + y + z) / 6)
        case Cylinder():
            return Cylinder((x + y) / 4, z)
        case Capsule():
            return Capsule((x + y) / 4, max(z - (x + y) / 2, 1e-6))
        case Mesh():
            return stretch(shape)
        case Compound(surface, parts):
            return Compound(stretch(surface), tuple(map(stretch, parts)))

"""Poses and shapes as small immutable values.

Lengths are metres, angles radians, quaternions (w, x, y, z). Roll, pitch and yaw are rotations about the fixed x, y and
z axes, in that order, as in URDF: ``R = Rz(yaw) @ Ry(pitch) @ Rx(roll)``.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:  # both are slow to import, and not needed to name poses and shapes
    import trimesh
    from scipy.spatial.transform import Rotation

Array = npt.NDArray[np.float64]
Vector = Sequence[float] | Array


def frozen_array(values: npt.ArrayLike, shape: tuple[int, ...] | None = None) -> Array:
    """Copy ``values`` to a read-only float64 array.

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


@dataclass(frozen=True, eq=False)
class Pose:
    """A position (3,) in metres and a unit quaternion (4,), (w, x, y, z), of one frame in another.

    Raises:
        ValueError: wrong shapes, numbers that are not finite, or a quaternion of length zero.
    """

    position: Array = field(default_factory=lambda: np.zeros(3))
    quaternion: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))

    def __post_init__(self) -> None:
        quaternion = np.array(self.quaternion, dtype=np.float64)
        length = np.linalg.norm(quaternion)
        if length < 1e-9:
            raise ValueError("a quaternion of length zero is no orientation")
        object.__setattr__(self, "position", frozen_array(self.position, (3,)))
        object.__setattr__(self, "quaternion", frozen_array(quaternion / length, (4,)))

    @classmethod
    def xyz_rpy(cls, xyz: Vector, rpy: Vector = (0.0, 0.0, 0.0)) -> Pose:
        """Make a pose from a position and fixed-axis roll, pitch, yaw."""
        from scipy.spatial.transform import Rotation

        return cls.from_rotation(xyz, Rotation.from_euler("xyz", np.asarray(rpy, dtype=np.float64)))

    @classmethod
    def from_rotation(cls, position: Vector, rotation: Rotation) -> Pose:
        x, y, z, w = rotation.as_quat()
        return cls(np.asarray(position, dtype=np.float64), np.array([w, x, y, z]))

    @classmethod
    def from_matrix(cls, matrix: Array) -> Pose:
        """Make a pose from a homogeneous (4, 4) matrix."""
        from scipy.spatial.transform import Rotation

        return cls.from_rotation(matrix[:3, 3], Rotation.from_matrix(matrix[:3, :3]))

    @cached_property
    def rotation(self) -> Rotation:
        from scipy.spatial.transform import Rotation

        w, x, y, z = self.quaternion
        return Rotation.from_quat([x, y, z, w])

    def __getstate__(self) -> dict[str, Array]:
        return {"position": self.position, "quaternion": self.quaternion}  # not the cached rotation

    @property
    def rpy(self) -> Array:
        """Fixed-axis roll, pitch, yaw (3,). At a pitch of 90 degrees they are not unique; there yaw is 0."""
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Gimbal lock")
            return self.rotation.as_euler("xyz")

    @property
    def matrix(self) -> Array:
        """The homogeneous (4, 4) matrix."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation.as_matrix()
        matrix[:3, 3] = self.position
        return matrix

    def __matmul__(self, other: Pose) -> Pose:
        """Compose poses: ``a @ b`` is the pose of b's frame where a is given, if b is given in a's frame."""
        return Pose.from_rotation(self.apply(other.position), self.rotation * other.rotation)

    def inverse(self) -> Pose:
        back = self.rotation.inv()
        return Pose.from_rotation(-(back.as_matrix() @ self.position), back)

    def apply(self, points: npt.ArrayLike) -> Array:
        """Transform points (..., 3) from this pose's frame to the frame that the pose is given in."""
        points = np.asarray(points, dtype=np.float64)
        return points @ self.rotation.as_matrix().T + self.position

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Pose)
            and np.array_equal(self.position, other.position)
            and np.array_equal(self.quaternion, other.quaternion)
        )

    def __hash__(self) -> int:
        return hash((self.position.tobytes(), self.quaternion.tobytes()))


def _positive(**lengths: float) -> None:
    for name, value in lengths.items():
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be a positive length in metres, got {value}")


@dataclass(frozen=True)
class Box:
    """A box of full side lengths (x, y, z), centred on its frame."""

    size: tuple[float, float, float]

    def __post_init__(self) -> None:
        x, y, z = (float(side) for side in self.size)
        _positive(x=x, y=y, z=z)
        object.__setattr__(self, "size", (x, y, z))

    @property
    def volume(self) -> float:
        return float(np.prod(self.size))

    def to_trimesh(self) -> trimesh.Trimesh:
        import trimesh

        return trimesh.creation.box(self.size)


@dataclass(frozen=True)
class Sphere:
    """A sphere centred on its frame."""

    radius: float

    def __post_init__(self) -> None:
        _positive(radius=self.radius)

    def to_trimesh(self) -> trimesh.Trimesh:
        import trimesh

        return trimesh.creation.icosphere(subdivisions=3, radius=self.radius)


@dataclass(frozen=True)
class Cylinder:
    """A cylinder along z, centred on its frame."""

    radius: float
    length: float

    def __post_init__(self) -> None:
        _positive(radius=self.radius, length=self.length)

    def to_trimesh(self) -> trimesh.Trimesh:
        import trimesh

        return trimesh.creation.cylinder(radius=self.radius, height=self.length, sections=48)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles: vertices (V, 3) in metres, faces (F, 3) of vertex numbers.

    As a collision shape it means its convex hull.
    """

    vertices: Array
    faces: npt.NDArray[np.int64]

    def __post_init__(self) -> None:
        vertices = frozen_array(self.vertices)
        faces = np.array(self.faces, dtype=np.int64)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
            raise ValueError(f"expected vertices (V, 3) and faces (F, 3), got {vertices.shape} and {faces.shape}")
        if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
            raise ValueError(
                f"faces: vertex numbers must be 0 to {len(vertices) - 1}, got {faces.min()} to {faces.max()}"
            )
        faces.setflags(write=False)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    @classmethod
    def from_trimesh(cls, mesh: trimesh.Trimesh) -> Mesh:
        return cls(np.asarray(mesh.vertices), np.asarray(mesh.faces))

    def to_trimesh(self) -> trimesh.Trimesh:
        import trimesh

        return trimesh.Trimesh(self.vertices, self.faces, process=False)


Shape = Box | Sphere | Cylinder | Mesh

"""Numbers, turns and poses, as small immutable values.

Lengths are metres, angles radians, quaternions (w, x, y, z). Roll, pitch and yaw are rotations about the fixed x, y and
z axes, in that order, as in URDF: ``R = Rz(yaw) @ Ry(pitch) @ Rx(roll)``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:  # slow to import, and not needed to name poses
    from scipy.spatial.transform import Rotation

Array = npt.NDArray[np.float64]
Vector = Sequence[float] | Array
Triple = tuple[float, ...]  # x, y and z
Color = tuple[float, ...]  # red, green, blue and opacity, 0..1

# From quaternions (w, x, y, z) to SciPy's order and back. Its own ``scalar_first`` takes two to four times as long.
_W_LAST = [1, 2, 3, 0]
_W_FIRST = [3, 0, 1, 2]


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
        from scipy.spatial.transform import Rotation

        return cls.from_rotation(xyz, Rotation.from_euler("xyz", rpy))

    @classmethod
    def from_rotation(cls, position: Vector, rotation: Rotation) -> Pose:
        """Make a pose from a position (3,) and a rotation."""
        return cls(np.asarray(position), rotation.as_quat()[_W_FIRST])

    @classmethod
    def from_matrix(cls, matrix: Array) -> Pose:
        """Make a pose from a homogeneous (4, 4) matrix."""
        from scipy.spatial.transform import Rotation

        return cls.from_rotation(matrix[:3, 3], Rotation.from_matrix(matrix[:3, :3]))

    @cached_property
    def rotation(self) -> Rotation:
        """The orientation as SciPy has it."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(self.quaternion[_W_LAST])

    @cached_property
    def rotation_matrix(self) -> Array:
        """The orientation as a matrix (3, 3), read-only."""
        return frozen_array(self.rotation.as_matrix())

    def __getstate__(self) -> dict[str, Array]:
        # Not what is cached.
        return {"position": self.position, "quaternion": self.quaternion}

    @property
    def rpy(self) -> Array:
        """Fixed-axis roll, pitch, yaw (3,). At a pitch of 90 degrees they are not unique; there yaw is 0."""
        return self.rotation.as_euler("xyz", suppress_warnings=True)

    @property
    def matrix(self) -> Array:
        """The homogeneous (4, 4) matrix."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation_matrix
        matrix[:3, 3] = self.position

        return matrix

    def __matmul__(self, other: Pose) -> Pose:
        """Compose poses: ``a @ b`` is the pose of b's frame where a is given, if b is given in a's frame."""
        turned = self.rotation * other.rotation
        return Pose.from_rotation(self.apply(other.position), turned)

    def inverse(self) -> Pose:
        """The pose of the frame that this one is given in, in this frame."""
        back = np.ascontiguousarray(self.rotation_matrix.T)
        return Pose.from_rotation(-(back @ self.position), self.rotation.inv())

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

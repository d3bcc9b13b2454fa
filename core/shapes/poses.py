"""Numbers, turns and poses, as small immutable values.

Lengths are metres, angles radians, quaternions (w, x, y, z). Roll, pitch and yaw are rotations about the fixed x, y and
z axes, in that order, as in URDF: ``R = Rz(yaw) @ Ry(pitch) @ Rx(roll)``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:  # slow to import, and not needed to name poses
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
_Part = TypeVar("_Part", float, Array)
_Parts = tuple[_Part, _Part, _Part, _Part]
_LOCKED_RAD = 1e-7  # nearer to a pitch of 90 degrees roll and yaw are one


def _normalise(w: float, x: float, y: float, z: float) -> Quaternion:
    """Make a quaternion's length 1."""
    length = math.sqrt(x * x + y * y + z * z + w * w)
    return w / length, x / length, y / length, z / length


def multiply(after: _Parts[_Part], first: _Parts[_Part]) -> _Parts[_Part]:
    """Multiply two quaternions, whose parts are numbers, or arrays for many at once.

    Args:
        after: the turn that comes second.
        first: the turn that comes first.
    """
    w, x, y, z = after
    v, a, b, c = first

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

    return np.array(multiply(about_z, multiply(about_y, about_x)))


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
        turned = _normalise(*multiply(self._unit, other._unit))
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

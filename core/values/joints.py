"""Define the joints between a scene's bodies, and read their positions from poses of bodies.

No engine is asked for a joint's position: it follows from the poses of the two bodies, the same way in every engine.
Plugins import it from `core.scene`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from core.geometry import Array, Pose, Vector, frozen_array

MAX_FORCE = 1e4  # N or N m, of any spring, latch or drive in a scene
MAX_POSITION = 1e3  # m or rad

_INVERSE = np.array([1.0, -1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Latch:
    """A place at which a joint is held, until it is pulled with more than ``force`` (N, or N m).

    Away from ``at`` by x the latch pulls back with force * sin(pi x / width); beyond ``width`` (m, or rad) it lets go,
    and it takes hold again when the joint comes back. A detent is the same.

    Raises:
        ValueError: ``force`` or ``width`` is not positive.
    """

    at: float
    force: float
    width: float

    def __post_init__(self) -> None:
        if not (
            abs(self.at) <= MAX_POSITION
            and 0 < self.force <= MAX_FORCE
            and 0 < self.width <= MAX_POSITION
        ):
            raise ValueError(
                f"a latch needs a place, a force up to {MAX_FORCE:g} and a width above 0, got {self}"
            )


@dataclass(frozen=True)
class Drive:
    """A motor that moves a joint through ``positions`` (m, or rad) at ``times`` (s), linearly in between.

    Time 0 is when the robot's motion begins; before, the joint is held where it is at time 0. After the last time it
    stays, or with ``repeats`` begins again. ``force`` (N, or N m) is the most that the motor can do.

    Raises:
        ValueError: the times do not rise from 0, there are not as many positions, or the force is not positive.
    """

    times: tuple[float, ...]
    positions: tuple[float, ...]
    force: float
    repeats: bool = False

    def __post_init__(self) -> None:
        if not self.times or self.times[0] != 0 or not all(np.diff(self.times) > 0):
            raise ValueError(
                f"a drive's times must begin at 0 and rise, got {self.times}"
            )
        if (
            len(self.positions) != len(self.times)
            or not (np.abs([*self.times, *self.positions]) <= MAX_POSITION).all()
        ):
            needed = f"a number for each of its {len(self.times)} times, up to {MAX_POSITION:g}"
            raise ValueError(f"a drive needs {needed}, got {self.positions}")
        if not 0 < self.force <= MAX_FORCE:
            raise ValueError(
                f"a drive's force must be above 0 and at most {MAX_FORCE:g}, got {self.force}"
            )
        if self.repeats and len(self.times) < 2:
            raise ValueError("a drive that repeats needs two times or more")

    def sample(self, times: Array) -> Array:
        """Return the positions at instants, in the shape of ``times``."""
        at = np.maximum(times, 0.0)
        at = np.mod(at, self.times[-1]) if self.repeats else at
        return np.interp(at, self.times, self.positions)


@dataclass(frozen=True)
class Joint:
    """A joint by which ``body`` moves against ``parent``, another body, or None for the world.

    The two never collide with each other. Units are SI, angles radians.

    Attributes:
        kind: ``hinge`` turns about the axis, ``slider`` moves along it, ``ball`` turns about ``origin`` in any way.
        axis: (3,) in the body's frame; it becomes a unit vector.
        origin: (3,) a point of the axis, in the body's frame.
        lower: with ``upper`` the range of positions; a ball has none.
        start: the position at which the scene has the two bodies. A hinge's counts counterclockwise about the axis.
        damping: N m s/rad, or N s/m.
        friction: the largest torque or force of dry friction, N m or N.
        stiffness: of a spring, N m/rad or N/m; 0: there is none. A ball's pulls back to how it starts.
        rest: where the spring is relaxed.
        latches: places that hold it.
        drive: a motor with a schedule.

    Raises:
        ValueError: says which of these can't be.
    """

    name: str
    kind: Literal["hinge", "slider", "ball"]
    body: str
    parent: str | None = None
    axis: Vector = (0.0, 0.0, 1.0)
    origin: Vector = (0.0, 0.0, 0.0)
    lower: float = -math.inf
    upper: float = math.inf
    start: float = 0.0
    damping: float = 0.0
    friction: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    latches: tuple[Latch, ...] = ()
    drive: Drive | None = None

    def __post_init__(self) -> None:
        where = f"joint {self.name!r}"
        if self.kind not in ("hinge", "slider", "ball"):
            raise ValueError(
                f"{where}: kind must be hinge, slider or ball, got {self.kind!r}"
            )
        length = float(np.linalg.norm(self.axis))
        if not (1e-6 < length < np.inf and np.isfinite(self.origin).all()):
            raise ValueError(
                f"{where}: its axis needs a length and its origin three numbers"
            )
        object.__setattr__(
            self, "axis", tuple(float(value) / length for value in self.axis)
        )
        if not (self.lower <= self.start <= self.upper and self.lower < self.upper):
            raise ValueError(
                f"{where}: it starts at {self.start:g}, outside of its range {self.lower:g}..{self.upper:g}"
            )
        if math.isfinite(self.lower) != math.isfinite(self.upper):
            raise ValueError(f"{where}: give both ends of its range, or neither")
        if self.limited and max(-self.lower, self.upper) > MAX_POSITION:
            raise ValueError(
                f"{where}: its range {self.lower:g}..{self.upper:g} must be within {MAX_POSITION:g} of 0"
            )
        if (
            self.kind == "hinge"
            and self.limited
            and self.upper - self.lower >= 2 * math.pi
        ):
            raise ValueError(
                f"{where}: its range must be less than a whole turn, or leave it out"
            )
        for name in ("damping", "friction", "stiffness"):
            if not 0 <= getattr(self, name) <= MAX_FORCE:
                raise ValueError(
                    f"{where}: {name} must be from 0 to {MAX_FORCE:g}, got {getattr(self, name)}"
                )
        if not (abs(self.rest) <= MAX_POSITION and abs(self.start) <= MAX_POSITION):
            raise ValueError(
                f"{where}: rest and start must be numbers up to {MAX_POSITION:g}"
            )
        if self.kind == "ball" and (
            self.limited or self.start or self.rest or self.latches or self.drive
        ):
            raise ValueError(
                f"{where}: a ball has no range, start, rest, latches or drive"
            )
        if self.drive is not None and (self.latches or self.stiffness or self.friction):
            raise ValueError(
                f"{where}: a joint with a drive has no latches, spring or friction"
            )

    @property
    def limited(self) -> bool:
        return math.isfinite(self.lower)


class JointState(NamedTuple):
    """A joint's position and speed, each (...): m and m/s, or rad and rad/s.

    A ball's are the angle from how it started, and its angular speed; neither is negative.
    """

    position: Array
    speed: Array


class Placement(NamedTuple):
    """Poses and velocities of one body: position, quaternion, linear and angular velocity, (..., 3) or (..., 4)."""

    position: Array
    quaternion: Array
    linear: Array
    angular: Array

    @classmethod
    def at_rest(cls, pose: Pose) -> Placement:
        return cls(pose.position, pose.quaternion, np.zeros(3), np.zeros(3))


@dataclass(frozen=True, eq=False)
class PlacedJoint:
    """A joint in a layout: how its body was in its parent's frame at the start."""

    joint: Joint  # the joint
    origin: Array  # (3,) the joint's origin in the parent's frame, at its start
    axis: Array  # (3,) its axis in the parent's frame
    turn: Array  # (4,) the body's quaternion in the parent's frame, at its start

    @classmethod
    def of(cls, joint: Joint, body: Pose, parent: Pose) -> PlacedJoint:
        inside = parent.inverse() @ body
        origin, axis = inside.apply(joint.origin), inside.rotation.apply(joint.axis)
        return cls(joint, frozen_array(origin), frozen_array(axis), inside.quaternion)

    def read(self, body: Placement, parent: Placement) -> JointState:
        """Compute position and speed from where the two bodies are, and how they move."""
        joint = self.joint
        spin = body.angular - parent.angular
        if joint.kind == "slider":
            arm = rotate(body.quaternion, np.asarray(joint.origin))
            there = body.position + arm - parent.position
            inside = rotate(parent.quaternion * _INVERSE, there)
            moved = (
                body.linear
                + np.cross(body.angular, arm)
                - parent.linear
                - np.cross(parent.angular, there)
            )
            axis = rotate(parent.quaternion, self.axis)
            return JointState(
                joint.start + (inside - self.origin) @ self.axis,
                (moved * axis).sum(axis=-1),
            )
        turned = multiply(
            multiply(parent.quaternion * _INVERSE, body.quaternion),
            self.turn * _INVERSE,
        )
        if joint.kind == "ball":
            angle = 2 * np.arctan2(
                np.linalg.norm(turned[..., 1:], axis=-1), np.abs(turned[..., 0])
            )
            return JointState(angle, np.linalg.norm(spin, axis=-1))
        middle = (joint.lower + joint.upper) / 2 if joint.limited else 0.0
        angle = joint.start + 2 * np.arctan2(
            turned[..., 1:] @ self.axis, turned[..., 0]
        )
        angle = middle + np.mod(angle - middle + np.pi, 2 * np.pi) - np.pi
        return JointState(
            angle, (spin * rotate(parent.quaternion, self.axis)).sum(axis=-1)
        )

    def carry(self, value: Array, speed: Array, parent: Placement) -> Placement:
        """Compute where the body is, and how it moves, for the joint's value and speed, each (...).

        A ball's value is the quaternion (..., 4) by which it turned in the parent's frame, its speed the angular
        velocity (..., 3) in the parent's frame.
        """
        joint = self.joint
        inside, turn, spin = self.origin, self.turn, np.zeros(3)
        glide = np.zeros(3)
        if joint.kind == "slider":
            inside = self.origin + np.multiply.outer(value - joint.start, self.axis)
            glide = rotate(parent.quaternion, np.multiply.outer(speed, self.axis))
        elif joint.kind == "hinge":
            half = (value - joint.start)[..., None] / 2
            turn = multiply(
                np.concatenate([np.cos(half), np.sin(half) * self.axis], axis=-1),
                self.turn,
            )
            spin = rotate(parent.quaternion, np.multiply.outer(speed, self.axis))
        else:
            turn, spin = multiply(value, self.turn), rotate(parent.quaternion, speed)
        quaternion = multiply(parent.quaternion, turn)
        there = rotate(parent.quaternion, inside)
        angular = parent.angular + spin
        arm = rotate(quaternion, np.asarray(joint.origin))
        linear = (
            parent.linear
            + np.cross(parent.angular, there)
            + glide
            - np.cross(angular, arm)
        )
        return Placement(parent.position + there - arm, quaternion, linear, angular)


def rotate(quaternion: Array, vector: Array) -> Array:
    """Rotate vectors (..., 3) by quaternions (..., 4)."""
    w, axis = np.split(quaternion, [1], axis=-1)
    return vector + 2 * np.cross(axis, w * vector + np.cross(axis, vector))


def multiply(one: Array, other: Array) -> Array:
    """Multiply quaternions (..., 4): first ``other``, then ``one``."""
    (w, a), (v, b) = np.split(one, [1], axis=-1), np.split(other, [1], axis=-1)
    real = w * v - (a * b).sum(axis=-1, keepdims=True)
    return np.concatenate([real, w * b + v * a + np.cross(a, b)], axis=-1)

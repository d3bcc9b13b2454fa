"""Define the joints between a scene's bodies, and read their positions from poses of bodies.

No engine is asked for a joint's position: it follows from the poses of the two bodies, the same way in every engine.
Plugins import it from `core.scene`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from core.errors import refuse
from core.geometry import Array, Pose, Vector, frozen_array

MAX_FORCE = 1e4  # N or N m, of any spring, latch or drive in a scene
MAX_POSITION = 1e3  # m or rad


@dataclass(frozen=True)
class Latch:
    """A place at which a joint is held, until it is pulled hard enough. A detent is the same.

    Away from ``at`` by x the latch pulls back with force * sin(pi x / width). Beyond ``width`` it lets go, and it takes
    hold again when the joint comes back.

    Attributes:
        at: the place, m or rad.
        force: with which it has to be pulled, N or N m.
        width: m or rad.

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
    """A motor that moves a joint through positions, linearly in between.

    Time 0 is when the robot's motion begins; before, the joint is held where it is at time 0.

    Attributes:
        times: rising from 0, s.
        positions: one for each time, m or rad.
        force: the most that the motor can do, N or N m.
        repeats: begin again after the last time; else the joint stays there.

    Raises:
        ValueError: the times do not rise from 0, there are not as many positions, or the force is not positive.
    """

    times: tuple[float, ...]
    positions: tuple[float, ...]
    force: float
    repeats: bool = False

    def __post_init__(self) -> None:
        count = len(self.times)
        numbers = np.abs([*self.times, *self.positions])
        problems = {
            f"a drive's times must begin at 0 and rise, got {self.times}": not (
                count and self.times[0] == 0 and (np.diff(self.times) > 0).all()
            ),
            f"a drive needs a number for each of its {count} times, up to {MAX_POSITION:g}, got {self.positions}": (
                len(self.positions) != count or not (numbers <= MAX_POSITION).all()
            ),
            f"a drive's force must be above 0 and at most {MAX_FORCE:g}, got {self.force}": (
                not 0 < self.force <= MAX_FORCE
            ),
            "a drive that repeats needs two times or more": self.repeats and count < 2,
        }
        refuse("", problems)

    def sample(self, times: Array) -> Array:
        """Return the positions at instants, in the shape of ``times``."""
        times = np.maximum(times, 0.0)
        if self.repeats:
            times = np.mod(times, self.times[-1])

        return np.interp(times, self.times, self.positions)


@dataclass(frozen=True)
class Joint:
    """A joint by which a body moves against another, or against the world. The two never collide with each other.

    Units are SI, angles radians.

    Attributes:
        name: of the joint.
        body: the name of what moves.
        parent: the name of what it moves against; None: the world.
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
        length = float(np.linalg.norm(self.axis))
        span = f"{self.lower:g}..{self.upper:g}"
        ends = [self.start, self.rest]
        if self.limited or math.isfinite(self.upper):
            ends += [self.lower, self.upper]

        turns = self.kind == "hinge" and self.limited
        moves = self.limited or self.start or self.rest or self.latches or self.drive
        holds = self.latches or self.stiffness or self.friction
        problems = {
            f"kind must be hinge, slider or ball, got {self.kind!r}": self.kind
            not in ("hinge", "slider", "ball"),
            "its axis needs a length and its origin three numbers": not (
                1e-6 < length < np.inf and np.isfinite(self.origin).all()
            ),
            f"it starts at {self.start:g}, outside of its range {span}": not (
                self.lower <= self.start <= self.upper and self.lower < self.upper
            ),
            f"rest, start and both ends of its range must be numbers up to {MAX_POSITION:g}": not (
                np.abs(ends).max() <= MAX_POSITION
            ),
            "its range is in radians, and must be less than a whole turn; or leave it out": (
                turns and self.upper - self.lower >= 2 * math.pi
            ),
            "a ball has no range, start, rest, latches or drive": bool(
                self.kind == "ball" and moves
            ),
            "a joint with a drive has no latches, spring or friction": bool(
                self.drive and holds
            ),
        }

        for name in ("damping", "friction", "stiffness"):
            value = getattr(self, name)
            problem = f"{name} must be from 0 to {MAX_FORCE:g}, got {value}"
            problems[problem] = not 0 <= value <= MAX_FORCE

        refuse(f"joint {self.name!r}: ", problems)
        unit = tuple(float(value) / length for value in self.axis)
        object.__setattr__(self, "axis", unit)

    @property
    def limited(self) -> bool:
        """Whether it has a range."""
        return math.isfinite(self.lower)

    @property
    def springs_back(self) -> bool:
        """Whether a spring moves it back where it is let go, as nothing holds it."""
        return self.stiffness > 0 and not self.latches


class JointState(NamedTuple):
    """A joint's position and speed, each (...): m and m/s, or rad and rad/s.

    A ball's are the angle from how it started, and its angular speed; neither is negative.
    """

    position: Array
    speed: Array


class Placement(NamedTuple):
    """Where one body is and how it moves, in the world.

    Attributes:
        position: (..., 3) metres.
        quaternion: (..., 4).
        linear: (..., 3) velocity, m/s.
        angular: (..., 3) velocity, rad/s.
    """

    position: Array
    quaternion: Array
    linear: Array
    angular: Array

    @classmethod
    def at_rest(cls, pose: Pose) -> Placement:
        """Place what does not move."""
        return cls(pose.position, pose.quaternion, np.zeros(3), np.zeros(3))


@dataclass(frozen=True, eq=False)
class PlacedJoint:
    """A joint in a layout: how its body was in its parent's frame at the start.

    Attributes:
        joint: the joint.
        origin: (3,) the joint's origin in the parent's frame, at its start.
        axis: (3,) its axis in the parent's frame.
        turn: (4,) the body's quaternion in the parent's frame, at its start.
    """

    joint: Joint
    origin: Array
    axis: Array
    turn: Array

    @classmethod
    def of(cls, joint: Joint, body: Pose, parent: Pose) -> PlacedJoint:
        """Place a joint by the poses of its body and of the parent at the start."""
        inside = parent.inverse() @ body
        origin = frozen_array(inside.apply(joint.origin))
        axis = frozen_array(inside.rotation.apply(joint.axis))

        return cls(joint, origin, axis, inside.quaternion)

    def read(self, body: Placement, parent: Placement) -> JointState:
        """Compute position and speed from where the two bodies are, and how they move."""
        joint = self.joint
        axis = rotate(parent.quaternion, self.axis)

        if joint.kind == "slider":
            arm = rotate(body.quaternion, np.asarray(joint.origin))
            there = body.position + arm - parent.position
            inside = rotate_back(parent.quaternion, there)
            moved = (
                body.linear
                + np.cross(body.angular, arm)
                - parent.linear
                - np.cross(parent.angular, there)
            )
            position = joint.start + (inside - self.origin) @ self.axis
            return JointState(position, (moved * axis).sum(axis=-1))

        spin = body.angular - parent.angular
        now = multiply(inverse(parent.quaternion), body.quaternion)
        turned = multiply(now, inverse(self.turn))
        real = turned[..., 0]
        imaginary = turned[..., 1:]

        if joint.kind == "ball":
            angle = 2 * np.arctan2(np.linalg.norm(imaginary, axis=-1), np.abs(real))
            return JointState(angle, np.linalg.norm(spin, axis=-1))

        angle = joint.start + 2 * np.arctan2(imaginary @ self.axis, real)
        middle = (joint.lower + joint.upper) / 2 if joint.limited else 0.0
        angle = middle + np.mod(angle - middle + np.pi, 2 * np.pi) - np.pi

        return JointState(angle, (spin * axis).sum(axis=-1))

    def carry(self, value: Array, speed: Array, parent: Placement) -> Placement:
        """Compute where the body is, and how it moves: the opposite of `read`.

        Args:
            value: of the joint (...); of a ball the quaternion (..., 4) by which it turned in the parent's frame.
            speed: of the joint (...); of a ball the angular velocity (..., 3) in the parent's frame.
            parent: where the parent is.
        """
        joint = self.joint
        inside = self.origin
        turn = self.turn
        spin = np.zeros(3)
        glide = np.zeros(3)

        if joint.kind == "ball":
            turn = multiply(value, self.turn)
            spin = rotate(parent.quaternion, speed)
        else:
            off = value - joint.start
            along = rotate(parent.quaternion, np.multiply.outer(speed, self.axis))
            if joint.kind == "slider":
                inside = self.origin + np.multiply.outer(off, self.axis)
                glide = along
            else:
                half = off[..., None] / 2
                parts = [np.cos(half), np.sin(half) * self.axis]
                turn = multiply(np.concatenate(parts, axis=-1), self.turn)
                spin = along

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
    """Rotate vectors.

    Args:
        quaternion: (..., 4) unit quaternions.
        vector: (..., 3).

    Returns:
        Vectors (..., 3).
    """
    w, axis = np.split(quaternion, [1], axis=-1)
    return vector + 2 * np.cross(axis, w * vector + np.cross(axis, vector))


def rotate_back(quaternion: Array, vector: Array) -> Array:
    """Rotate vectors (..., 3) by the inverses of unit quaternions (..., 4)."""
    return rotate(inverse(quaternion), vector)


def inverse(quaternion: Array) -> Array:
    """Invert unit quaternions (..., 4)."""
    return quaternion * [1.0, -1.0, -1.0, -1.0]


def multiply(after: Array, first: Array) -> Array:
    """Multiply quaternions.

    Args:
        after: (..., 4) the turn that comes second.
        first: (..., 4) the turn that comes first.

    Returns:
        Both turns in one (..., 4).
    """
    w, x, y, z = np.moveaxis(after, -1, 0)
    v, a, b, c = np.moveaxis(first, -1, 0)
    real = w * v - x * a - y * b - z * c
    about_x = w * a + v * x + (y * c - z * b)
    about_y = w * b + v * y + (z * a - x * c)
    about_z = w * c + v * z + (x * b - y * a)
    return np.stack([real, about_x, about_y, about_z], axis=-1)

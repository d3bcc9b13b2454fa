"""Hold a robot's description as data: links, joints, shapes and inertias, as a URDF has them.

Numbers stay as they were written, so that `core.robot.description` writes them again to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from core.geometry import Array, Color, Pose, Primitive, Shape, Triple, Vector

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
MOVING = ("revolute", "continuous", "prismatic")

# Mass, its centre (3,), and the inertia tensor (3, 3) about it; one frame for all.
Weight = tuple[float, Array, Array]
ZERO: Triple = (0.0, 0.0, 0.0)
ONE: Triple = (1.0, 1.0, 1.0)


# How numbers are rounded before they are written.
PICOMETRES = ".12f"
DIGITS = ".15g"


def rounded(value: float, form: str = DIGITS) -> float:
    """Round a number to what a format shows of it."""
    return float(format(value, form)) + 0.0


def rounded_all(values: Vector, form: str = DIGITS) -> Triple:
    """Round numbers; see `rounded`."""
    return tuple(rounded(value, form) for value in values)


def rounded_shape(shape: Primitive, form: str = PICOMETRES) -> Primitive:
    """Round the lengths of a shape."""
    return shape.of(*rounded_all(shape.numbers, form))


@dataclass(frozen=True)
class Origin:
    """A frame as URDF has it: ``xyz``, metres, and ``rpy`` about fixed axes, radians."""

    xyz: Triple = ZERO
    rpy: Triple = ZERO

    @classmethod
    def from_pose(cls, pose: Pose, form: str = PICOMETRES) -> Origin:
        """Make the frame of a pose, rounded."""
        return cls(rounded_all(pose.position, form), rounded_all(pose.rpy, form))

    @cached_property
    def pose(self) -> Pose:
        return Pose.xyz_rpy(self.xyz, self.rpy)


@dataclass(frozen=True)
class Inertial:
    """The mass of a link, kg, its centre in the link's frame, metres, and its inertia about the centre, kg m^2.

    ``moments``: xx, xy, xz, yy, yz, zz, in axes that ``rpy`` turns in the link's frame.
    """

    mass: float = 0.0
    center: Triple = ZERO
    moments: tuple[float, ...] = (0.0,) * 6
    rpy: Triple = ZERO

    @classmethod
    def from_tensor(
        cls, mass: float, center: Array, tensor: Array, form: str = PICOMETRES
    ) -> Inertial:
        """Take an inertia in the link's axes, rounded; ``form`` is that of the centre."""
        moments = rounded_all(tensor[np.triu_indices(3)])
        return cls(rounded(mass), rounded_all(center, form), moments)

    @property
    def tensor(self) -> Array:
        """The tensor (3, 3) about the centre, in the inertia's own axes."""
        xx, xy, xz, yy, yz, zz = self.moments
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    def placed(self, link: Pose | None = None) -> Weight:
        """Place it in a frame in which the link has a pose; None: in the link's own."""
        pose = Origin(self.center, self.rpy).pose
        if link is not None:
            pose = link @ pose
        axes = pose.rotation_matrix
        return self.mass, pose.position, axes @ self.tensor @ axes.T


@dataclass(frozen=True)
class RobotShape:
    """A shape of a link, in the link's frame, or a mesh file with its scale; without a colour there is no material.

    ``friction``: the coefficient; a URDF has none.
    """

    shape: Shape | Path
    origin: Origin = Origin()
    color: Color | None = None
    scale: Triple = ONE
    friction: float | None = None

    def placed(self, pose: Pose) -> RobotShape:
        """Write it in another frame, in which its link's has a pose."""
        origin = Origin.from_pose(pose @ self.origin.pose, DIGITS)
        return replace(self, origin=origin)


@dataclass(frozen=True)
class RobotLink:
    """A link: its inertia, and its shapes.

    ``frame``: where the body of an MJCF file has its own frame, which a joint may be away from, in the link's; metres.
    """

    name: str
    inertial: Inertial = Inertial()
    collisions: tuple[RobotShape, ...] = ()
    visuals: tuple[RobotShape, ...] = ()
    frame: Triple = ZERO


class Limits(NamedTuple):
    """The limits of a joint, in radians or metres, N m or N, and 1/s; None where none is written."""

    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    velocity: float | None = None


class Mimic(NamedTuple):
    """The joint that another one follows: the other's value is ``multiplier`` times this one's plus ``offset``."""

    joint: str
    multiplier: float
    offset: float


NO_LIMITS = Limits()


@dataclass(frozen=True)
class RobotJoint:
    """A joint: its frame in the parent's, its axis (3,), limits, and dynamics.

    ``spring``: stiffness and rest; a URDF has none, but for a tool's. ``armature``: the motor's inertia, kg m^2, and
    ``start``: where the joint is at first; only an MJCF file has them.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Origin = Origin()
    axis: Triple = (1.0, 0.0, 0.0)
    limits: Limits = NO_LIMITS
    mimic: Mimic | None = None
    damping: float = 0.0
    friction: float = 0.0
    spring: tuple[float, float] | None = None
    armature: float = 0.0
    start: float = 0.0

    @classmethod
    def fixed(
        cls, name: str, parent: str, child: str, pose: Pose, form: str = PICOMETRES
    ) -> RobotJoint:
        """Make a joint that does not move, at a pose, rounded."""
        return cls(name, "fixed", parent, child, Origin.from_pose(pose, form))

    @property
    def direction(self) -> Array:
        """The axis (3,) as a unit vector."""
        axis = np.array(self.axis)
        return axis / max(float(np.linalg.norm(axis)), 1e-6)

    def moved(self, value: float) -> Pose:
        """Place what the joint bears at a value, radians or metres, in its frame at 0."""
        way = value * self.direction
        if self.kind == "prismatic":
            return Pose(way)

        from scipy.spatial.transform import Rotation  # lists of plugins need it not

        return Pose.from_rotation((0.0, 0.0, 0.0), Rotation.from_rotvec(way))

    @property
    def range(self) -> tuple[float, float]:
        """The lower and the upper limit; 0 where they are missing, as in URDF."""
        return self.limits.lower or 0.0, self.limits.upper or 0.0


@dataclass(frozen=True)
class Description:
    """A tree of links: the name of the robot, its links by name, and its joints by the link that they bear."""

    name: str
    links: dict[str, RobotLink]
    joints: dict[str, RobotJoint] = field(default_factory=dict)

    @property
    def root(self) -> str:
        """The link that no joint bears."""
        return next(name for name in self.links if name not in self.joints)

    @cached_property
    def named(self) -> dict[str, RobotJoint]:
        """The joints by their names."""
        return {joint.name: joint for joint in self.joints.values()}

    def above(self, link: str) -> list[str]:
        """List a link and those that bear it, up to the root."""
        chain = [link]
        while chain[-1] in self.joints:
            chain.append(self.joints[chain[-1]].parent)
        return chain

    def without(self, *links: str) -> Description:
        """Remove links and all that they bear."""
        kept = {
            name: link
            for name, link in self.links.items()
            if not {*links} & {*self.above(name)}
        }
        joints = {child: joint for child, joint in self.joints.items() if child in kept}

        return Description(self.name, kept, joints)

    def renamed(
        self,
        names: Mapping[str, str],
        joint_names: Mapping[str, str] = MappingProxyType({}),
    ) -> Description:
        """Give links and joints other names."""
        new = {name: names.get(name, name) for name in self.links}
        links = {
            new[name]: replace(link, name=new[name])
            for name, link in self.links.items()
        }
        joints = {
            new[child]: replace(
                joint,
                name=joint_names.get(joint.name, joint.name),
                parent=new[joint.parent],
                child=new[child],
            )
            for child, joint in self.joints.items()
        }

        return Description(self.name, links, joints)

    def rigid_parts(self, heads: Iterable[str]) -> dict[str, tuple[str, Pose]]:
        """Map each link to the link in ``heads`` (or the root) that it is rigidly joined to, and its pose in it."""
        ends = {*heads, self.root}

        @cache
        def part(link: str) -> tuple[str, Pose]:
            if link in ends:
                return link, Pose()
            head, pose = part(self.joints[link].parent)
            return head, pose @ self.joints[link].origin.pose

        return {name: part(name) for name in self.links}

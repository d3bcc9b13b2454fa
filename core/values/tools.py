"""Define tools: components, the joints between them, and the convex shapes that collide."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np

from core.errors import CodedError
from core.geometry import Array, Color, Pose, Shape, Triple
from core.values.contents import content_of, digest
from core.values.grips import Grip
from core.values.refusals import DesignReason

RIGID_MOUNT = "tool_mount"
GRIPPER_MOUNTS = ("left_finger", "right_finger")
TOOL_FRICTION = 0.5  # of printed plastic
MAX_JOINTS = 8  # of a tool; engines make room for so many


Places = dict[str, tuple[str, Pose]]
"""What bears each component, and its pose in that frame."""


class DesignError(CodedError, ValueError):
    """A design breaks a rule. The message says what is wrong, where, and how to mend it."""


@dataclass(frozen=True)
class ToolJoint:
    """A joint without a motor, by which a component moves against its parent. Units are SI, angles radians.

    Attributes:
        kind: ``hinge`` or ``slider``.
        axis: (3,) the direction that it turns about or moves along, in the component's frame; it becomes a unit vector.
        lower: with ``upper`` its range; at 0 the component is where its pose says.
        origin: (3,) a point of a hinge's axis, in the component's frame.
        damping: N m s/rad, or N s/m.
        friction: the largest torque or force of dry friction, N m or N.
        stiffness: of a spring, N m/rad or N/m; 0: there is none.
        rest: where the spring is relaxed.

    Raises:
        DesignError: the axis has no length, 0 is not in the range, or a number is negative that must not be.
    """

    kind: Literal["hinge", "slider"]
    axis: Triple
    lower: float
    upper: float
    origin: Triple = (0.0, 0.0, 0.0)
    damping: float = 0.0
    friction: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0

    def __post_init__(self) -> None:

        length = float(np.linalg.norm(self.axis))
        if not 1e-6 < length < np.inf:
            raise DesignError.because(DesignReason.JOINT_AXIS)

        unit = tuple(float(value) / length for value in self.axis)
        object.__setattr__(self, "axis", unit)

        if not self.lower <= 0 <= self.upper or self.lower == self.upper:
            raise DesignError.because(
                DesignReason.JOINT_RANGE, lower=self.lower, upper=self.upper
            )

        for name in ("damping", "friction", "stiffness"):
            if not getattr(self, name) >= 0:
                given = getattr(self, name)
                raise DesignError.because(
                    DesignReason.JOINT_NEGATIVE, name=name, given=given
                )

    @property
    def strain(self) -> float:
        """How far from its rest a spring is within the range, at most."""
        return max(abs(self.lower - self.rest), abs(self.upper - self.rest))

    @property
    def energy(self) -> float:
        """What a spring holds where it is strained most, J."""
        return self.stiffness * self.strain**2 / 2


@dataclass(frozen=True)
class Component:
    """One solid of a tool, its pose given in the frame of its parent: another component, or a mount link of the robot.

    A `Mesh` is closed and convex. With a ``joint`` it moves against its parent, and bears its own children. A face of
    one that ``grips`` holds what it touches.
    """

    name: str
    parent: str
    pose: Pose
    shape: Shape
    mass: float = 0.005
    color: Color = (0.2, 0.45, 0.8, 1.0)
    joint: ToolJoint | None = None
    grips: Grip | None = None

    @property
    def link(self) -> Pose:
        """The frame of the component's link in its own frame: at the joint's origin, if it has one."""
        return Pose() if self.joint is None else Pose(np.array(self.joint.origin))


class ConvexPart(NamedTuple):
    """A convex shape of a tool and the name of its component.

    ``pose`` is in the frame of ``bearer``: a mount, or a component with a joint, whose frame is `Component.link`.
    """

    component: str
    shape: Shape
    bearer: str
    pose: Pose


class Bearer(NamedTuple):
    """A component with a joint: its frame in that of the bearer before it, its joint at 0."""

    name: str
    parent: str
    pose: Pose
    joint: ToolJoint


@dataclass(frozen=True)
class Tool:
    """Joined solids: a tool on `RIGID_MOUNT`, or with ``gripper`` attachments to the fingers `GRIPPER_MOUNTS`.

    Without components it is the bare arm (with ``gripper``: the bare hand). Parents come before their children.
    ``friction`` is that of a rigid tool; attachments to the fingers have that of the fingers. ``written`` is the text
    that it was read from, and the `content` that this had: numbers of another text may differ in their last bits.
    ``fixture`` stands in the scene meanwhile.

    Raises:
        DesignError: a name is used twice, or a parent is neither a component before it nor a mount.
    """

    components: tuple[Component, ...] = ()
    gripper: bool = False
    name: str = ""
    description: str = ""
    friction: float = TOOL_FRICTION
    written: tuple[str, str] = field(default=("", ""), compare=False, repr=False)
    fixture: Fixture | None = None

    def __hash__(self) -> int:  # many things are kept by tool, and poses take long
        return hash(
            (self.name, self.gripper, tuple((c.name, c.mass) for c in self.components))
        )

    def __post_init__(self) -> None:
        known = set(self.mounts)
        for component in self.components:
            if component.name in known:
                raise DesignError.because(DesignReason.NAMED_TWICE, name=component.name)
            if component.parent not in known:
                raise DesignError.because(
                    DesignReason.NO_PARENT,
                    component=component.name,
                    parent=component.parent,
                    mounts=" or ".join(self.mounts),
                )
            known.add(component.name)

    @property
    def mounts(self) -> tuple[str, ...]:
        return GRIPPER_MOUNTS if self.gripper else (RIGID_MOUNT,)

    @property
    def mass(self) -> float:
        return sum(component.mass for component in self.components)

    @property
    def gripping(self) -> tuple[Component, ...]:
        """The components that grip."""
        return tuple(c for c in self.components if c.grips is not None)

    @cached_property
    def content(self) -> str:
        """A hash of what is simulated: equal for tools that differ in name and description only."""
        return digest(
            content_of(replace(self, name="", description="", written=("", "")))
        )

    def placed(self) -> Places:
        """Return for each component its mount and its pose in the mount's frame, with all joints at 0."""
        return dict(self._placed)

    @cached_property
    def _placed(self) -> Places:
        return self._place(across_joints=True)

    @cached_property
    def borne(self) -> Places:
        """For each component the mount or the component with a joint that bears it, and its pose in that frame."""
        return self._place(across_joints=False)

    def _place(self, *, across_joints: bool) -> Places:
        """Find for each component what bears it, and its pose in that frame."""
        places = {mount: (mount, Pose()) for mount in self.mounts}

        for component in self.components:
            bearer, pose = places[component.parent]
            place = bearer, pose @ component.pose
            if component.joint is not None and not across_joints:
                place = component.name, component.link.inverse()

            places[component.name] = place

        return {component.name: places[component.name] for component in self.components}

    @cached_property
    def parts(self) -> tuple[ConvexPart, ...]:
        """The convex shapes that collide, in the order of the components."""
        parts = []

        for component in self.components:
            bearer, pose = self.borne[component.name]
            for shape in component.shape.convex_parts():
                parts.append(ConvexPart(component.name, shape, bearer, pose))

        return tuple(parts)

    @property
    def borne_on(self) -> tuple[str, ...]:
        """The links that its components are part of: its mounts, and its components with a joint."""
        return (*self.mounts, *(c.name for c in self.components if c.joint is not None))

    @cached_property
    def bearers(self) -> tuple[Bearer, ...]:
        """The K components with a joint, in the order of the joints' values."""
        bearers = []

        for component in self.components:
            if component.joint is not None:
                parent = component.parent
                bearer, pose = self.borne.get(parent, (parent, Pose()))
                frame = pose @ component.pose @ component.link
                bearers.append(Bearer(component.name, bearer, frame, component.joint))

        return tuple(bearers)


@dataclass(frozen=True)
class Fixture:
    """What a design adds to the scene, and no plan moves: ``parts``, written as a rigid tool, whose mount is at a pose.

    Attributes:
        parts: its components, without joints.
        pose: of their mount's frame, in the world.
    """

    parts: Tool
    pose: Pose

    @property
    def upright(self) -> Fixture:
        """The same solids at the same place, written in a frame whose z is the world's: it has the pose's yaw alone."""
        roll, pitch, yaw = self.pose.rpy.tolist()
        if not (roll or pitch):
            return self

        frame = Pose.xyz_rpy(self.pose.position, (0.0, 0.0, yaw))
        tilt = frame.inverse() @ self.pose
        tilted = [
            replace(part, pose=tilt @ part.pose) if part.parent == RIGID_MOUNT else part
            for part in self.parts.components
        ]
        return Fixture(replace(self.parts, components=tuple(tilted)), frame)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """The lowest and the highest corner (3,) of the box around it, along the axes of its frame, m."""
        boxes = [part.pose.apply(part.shape.corners) for part in self.parts.parts]
        points = np.concatenate(boxes)
        return points.min(axis=0), points.max(axis=0)

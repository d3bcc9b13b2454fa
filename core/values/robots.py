"""Define a robot: an arm as data, from which all else about it is computed (`core.robot`).

Plugins import all of it from `core.interfaces`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from core.errors import UsageError, check_positive
from core.geometry import Cylinder, Pose
from core.values.descriptions import Description

LINK_FRICTION = 0.5  # of an arm's links


@dataclass(frozen=True)
class Flange:
    """The disc that bears a rigid tool, centred at the mount's origin and square to its z, and its ring of bolts.

    The face that a tool is bolted to is the plane z = 0 of the mount. Angles are about the mount's z, from its x.

    Attributes:
        disc: bears the tool in simulation.
        bolt_circle_m: diameter of the ring of bolts.
        bolts: how many, equally spaced.
        thread: such as M6.
        thread_depth_m: how deep a screw may go.
        bolt_angle: of the first bolt.
        pin_m: diameter of the locating pin, on the ring of bolts.
        pin_angle: where the pin is; None: not known, so that a tool gets no hole for it.
        centring_m: diameter of the recess in the middle; None: there is none.
        centring_depth_m: its depth.
    """

    disc: Cylinder
    bolt_circle_m: float
    bolts: int
    thread: str
    thread_depth_m: float = 0.006
    bolt_angle: float = math.pi / 4
    pin_m: float = 0.006
    pin_angle: float | None = None
    centring_m: float | None = None
    centring_depth_m: float = 0.0035


# ISO 9409-1-50-4-M6: four M6 on a circle of 50 mm at 45 degrees from the pin (6 H7, on the same circle), a disc of
# 63 mm, a recess of 31.5 H7 at least 3.5 mm deep. Threads of 6 mm are a cautious guess.
ISO_9409_1_50 = Flange(
    Cylinder(radius=0.0315, length=0.01), 0.05, 4, "M6", centring_m=0.0315
)


@dataclass(frozen=True)
class Gripper:
    """A parallel gripper: two fingers that prismatic joints move apart, from 0 to ``travel_m`` each.

    Attributes:
        link: its first link. It goes, with all that it bears, where a rigid tool is mounted.
        mount: the pose of the tool mount in the frame of ``link``: the same place as the robot's.
        near_mount: the links that an attachment to a finger may overlap, beside that finger.
        joints: of the left finger and of the right one.
        links: the left finger and the right one, which bear attachments.
        travel_m: how far each finger opens.
        force_n: of each finger, continuous.
        friction: of the fingers.
    """

    link: str
    mount: Pose
    near_mount: tuple[str, ...]
    joints: tuple[str, str]
    links: tuple[str, str]
    travel_m: float
    force_n: float
    friction: float = 1.0


@dataclass(frozen=True)
class Robot:
    """An arm of J joints, as data.

    Attributes:
        name: as in ``robot=NAME``.
        title: as people call it, with its maker.
        description: its links and joints, with absolute paths of meshes. Collision meshes count as their convex hulls.
        arm_joints: the names of its J joints, from the base to the flange.
        home: joints (J,) from which inverse kinematics starts, in radians, or metres where a joint slides: it chooses
            elbow and wrist, and they stay.
        acceleration_limits: of each joint (J,), rad/s^2 or m/s^2.
        motor_inertia: of each joint (J,), reflected through its gear, kg m^2 or kg; a URDF has none of it.
        mount_link: the link whose frame ``mount`` is given in.
        mount: the pose of the tool mount. At home its z points up, away from the tool, which extends toward -z.
        near_mount: the links that a rigid tool may overlap at the flange.
        payload_kg: what it carries at most.
        flange: bears rigid tools.
        gripper: the gripper of the description, or None.
        friction: of its links.
        aliases: other names of mounts that designs may use, as pairs (other name, mount).
        base: where its base stands in the world.
        measured: how exact it is, by engine and figure (``tests.benchmarks.exactness``).
        programs: files for the arm's controller that an export has, as pairs of name and Jinja template.
        drivers: what moves the arm by a plan that feels or looks, as pairs of name and Jinja template of an export's
            ``drive_NAME.py``: each has a class ``Driver`` that is made with the arm's address
            (`plugins.results.workshop.carrying`).
        enlarged: how many times as large it is as the arm that stands in the lab; see `life_size`.
        original: the arm that stands in the lab, at the world's origin; None: it is this one.

    Raises:
        UsageError: numbers of joints differ, or a number is not finite or not positive.
    """

    name: str
    title: str
    description: Description = field(repr=False)
    arm_joints: tuple[str, ...]
    home: tuple[float, ...]
    acceleration_limits: tuple[float, ...]
    motor_inertia: tuple[float, ...]
    mount_link: str
    mount: Pose
    near_mount: tuple[str, ...]
    payload_kg: float
    flange: Flange = ISO_9409_1_50
    gripper: Gripper | None = None
    friction: float = LINK_FRICTION
    aliases: tuple[tuple[str, str], ...] = ()
    base: Pose = field(default_factory=Pose)
    measured: Mapping[str, Mapping[str, float | None]] = field(
        default_factory=dict, compare=False, repr=False
    )
    programs: tuple[tuple[str, str], ...] = field(default=(), compare=False, repr=False)
    drivers: tuple[tuple[str, str], ...] = field(default=(), compare=False, repr=False)
    enlarged: float = 1.0
    original: Robot | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        count = len(self.arm_joints)
        for name in ("home", "acceleration_limits", "motor_inertia"):
            values = getattr(self, name)
            if len(values) != count or not all(map(math.isfinite, values)):
                raise UsageError(
                    f"robot {self.name}: {name} needs {count} finite numbers, one for each joint, got {values}"
                )
        if not min(self.acceleration_limits) > 0 or min(self.motor_inertia) < 0:
            raise UsageError(
                f"robot {self.name}: acceleration limits must be positive, inertias 0 or more"
            )
        check_positive(f"robot {self.name}: ", payload_kg=self.payload_kg)

    def __hash__(self) -> int:
        return hash((self.name, self.base, self.mount, self.home))

    @cached_property
    def life_size(self) -> Robot:
        """The arm as it stands in the lab, where this one is simulated larger in its place."""
        if self.original is None:
            return self

        base = Pose(self.base.position / self.enlarged, self.base.quaternion)
        return replace(self.original, base=base)

    @cached_property
    def slides(self) -> tuple[bool, ...]:
        """Whether each of the arm's joints slides (J,); the others turn."""
        joints = self.description.named
        return tuple(joints[name].kind == "prismatic" for name in self.arm_joints)

    @property
    def finger_joints(self) -> tuple[str, ...]:
        return self.gripper.joints if self.gripper else ()

    @property
    def opening_m(self) -> float:
        """How far each finger opens, metres; 0 without a gripper."""
        return self.gripper.travel_m if self.gripper else 0.0

    def joints(self, gripper: bool) -> tuple[str, ...]:
        """List the joints that are driven, with or without the gripper."""
        return (*self.arm_joints, *(self.finger_joints if gripper else ()))

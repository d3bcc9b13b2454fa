"""Make a robot of a URDF or Xacro file, of which the arm, its home and its flange are chosen."""

from __future__ import annotations

import importlib.util
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pydantic import ConfigDict
from scipy.spatial.transform import Rotation

from core.errors import UsageError, UserError, check_positive, choices
from core.geometry import Array, Cylinder, Pose
from core.robot.description import RESERVED, write
from core.robot.kinematics import Arm, link_poses
from core.robot.solids import robot_solids
from core.support.files import read_untrusted
from core.support.sandbox import isolated
from core.support.text import clean, short_numbers
from core.values.descriptions import MOVING, Description, Limits, RobotJoint
from core.values.robots import ISO_9409_1_50, Flange, Gripper, Robot
from core.values.urdf import MAX_BYTES, read_description
from plugins.robots.normalise import normalised
from plugins.robots.xacro import expand

# A URDF has none of these; each is a setting.
REACHES_SPEED_S = 0.5  # in which a joint reaches its speed limit; arms that are built in need 0.13 to 0.79 s
MOTOR_INERTIA = 0.1  # kg m^2, as MuJoCo Menagerie has it for arms that carry 3.5 to 12.5 kg
PAYLOAD_KG = 1.0
XACRO_S = 60

_TURN = 2 * math.pi  # a continuous joint turns this far each way: limits are finite everywhere
_TILT_RAD = 0.35  # at most between the mount's axes at home and the world's
_UNDER_M = 0.005


@dataclass(frozen=True)
class GripperOptions:
    """Say what a description does not say of its parallel gripper.

    Attributes:
        link: its first link. It goes, with all that it bears, where a rigid tool is mounted.
        joints: of its two fingers: prismatic, 0 when closed.
        force_n: of each finger; None: the smaller effort in the joints' limits.
        friction: of the fingers.
    """

    link: str
    joints: tuple[str, str]
    force_n: float | None = None
    friction: float = 1.0

    __pydantic_config__: ClassVar[ConfigDict] = {"extra": "forbid"}


@dataclass(frozen=True)
class BoltOptions:
    """Say where a flange has its bolts, metres and radians; the defaults are those of ISO 9409-1-50-4-M6.

    Attributes:
        circle_m: diameter of the ring of bolts.
        count: how many, equally spaced.
        thread: such as M6.
        angle: of the first bolt, about the mount's z from its x.
        disc_m: diameter of the flange.
        centring_m: diameter of the recess in the middle; None: there is none.

    Raises:
        UsageError: a number is not positive, or the ring does not lie on the disc.
    """

    circle_m: float = 0.05
    count: int = 4
    thread: str = "M6"
    angle: float = math.pi / 4
    disc_m: float = 0.063
    centring_m: float | None = 0.0315

    __pydantic_config__: ClassVar[ConfigDict] = {"extra": "forbid"}

    def flange(self) -> Flange:
        check_positive("robot.bolts.", circle_m=self.circle_m, count=self.count, disc_m=self.disc_m)
        if not (self.centring_m or 0.0) < self.circle_m < self.disc_m < 1.0:
            raise UsageError("robot.bolts: lengths are diameters in metres, centring_m < circle_m < disc_m")
        disc, ring = Cylinder(self.disc_m / 2, ISO_9409_1_50.disc.length), (self.circle_m, self.count, self.thread)
        return Flange(disc, *ring, bolt_angle=self.angle, centring_m=self.centring_m)


@dataclass(frozen=True)
class ArmSettings:
    """What is chosen of a file, and what a description does not say of its arm.

    Attributes:
        path: a URDF file, or one whose name ends in ``.xacro``.
        home: joints (J,) from the base on, radians; there the flange looks down.
        flange: the link that bears tools; None: the only one that bears no other link.
        title: as people call it; empty: the name in the description.
        mount_rpy: how the mount is turned in the flange's frame, radians; None: by right angles, so that its axes at
            home are nearest to the world's.
        payload_kg: what it carries at most.
        acceleration: limits (J,), rad/s^2; None: each joint reaches its speed limit in `REACHES_SPEED_S`.
        motor_inertia: (J,), reflected through the gears, kg m^2; None: `MOTOR_INERTIA` each.
        gripper: the parallel gripper, if there is one.
        bolts: of the flange; None: those of ISO 9409-1-50-4-M6.
        fixed: joints that are held at 0.
        without: links that are left out, with all that they bear.
        arguments: of a Xacro file.
    """

    path: Path
    home: list[float]
    flange: str | None = None
    title: str = ""
    mount_rpy: tuple[float, float, float] | None = None
    payload_kg: float = PAYLOAD_KG
    acceleration: list[float] | None = None
    motor_inertia: list[float] | None = None
    gripper: GripperOptions | None = None
    bolts: BoltOptions | None = None
    fixed: list[str] | None = None
    without: list[str] | None = None
    arguments: Mapping[str, str] | None = None


def read_robot(
    path: Path, home: Sequence[float], flange: str | None = None, *, name: str = "urdf", **settings: Any
) -> Robot:
    """Make a robot of a file. Its base is the only link that has no parent.

    Args:
        path: see `ArmSettings`, as for ``home`` and ``flange``.
        home: see there.
        flange: see there.
        name: the robot's, as in ``robot=NAME``.
        settings: the others of `ArmSettings`.

    Raises:
        UserError: the file or something in it can't be used; says what, where, and how to mend it.
    """
    path = path.expanduser().absolute()
    chosen = ArmSettings(path, list(home), flange, **settings)
    description = read_description(
        _text(path, chosen.arguments or {}), path, tuple(chosen.without or ()), taken=RESERVED
    )
    try:
        return _robot(description, chosen, name)
    except UserError as error:
        raise type(error)(f"{path}: {error}") from error


def _robot(description: Description, chosen: ArmSettings, name: str) -> Robot:
    link, fixed = _flange(description, chosen.flange), chosen.fixed or ()
    arm = [_turning(joint) for joint in _arm(description, link, fixed)]
    home = _home(chosen.home, arm)
    grip, fingers = (None, []) if chosen.gripper is None else _gripper(description, chosen.gripper, link, arm)
    drives = {joint.name: joint for joint in (*arm, *fingers)}
    _check_rest(description, drives, fixed)
    parts = description.rigid_parts(joint.child for joint in arm)
    if not any(description.links[name].collisions for name, (head, _) in parts.items() if head != description.root):
        raise UserError("the arm has no collision shape; repeat each <visual> as <collision>: its hull counts")
    speeds = [joint.limits.velocity or 0.0 for joint in arm]
    robot = Robot(
        name=name,
        title=chosen.title or clean(description.name, 60),
        urdf=write(normalised(description, drives, link, [grip.link] if grip else [])),
        arm_joints=tuple(joint.name for joint in arm),
        home=home,
        acceleration_limits=tuple(chosen.acceleration or (speed / REACHES_SPEED_S for speed in speeds)),
        motor_inertia=tuple(chosen.motor_inertia or [MOTOR_INERTIA] * len(arm)),
        mount_link=link,
        mount=Pose(),
        near_mount=tuple(dict.fromkeys([parts[link][0], link])),
        payload_kg=chosen.payload_kg,
        gripper=grip,
        flange=(chosen.bolts or BoltOptions()).flange(),
    )
    mount = _mount(robot, parts[link][1].rotation.inv().apply(arm[-1].direction), chosen.mount_rpy)
    if grip is not None:
        grip = replace(grip, mount=grip.mount @ mount)
    return _straightened(replace(robot, mount=mount, gripper=grip))


def _text(path: Path, arguments: Mapping[str, str]) -> bytes:
    """Read a description, or expand it.

    Raises:
        UserError: it can't be read; or Xacro is not installed, or fails.
    """
    data = read_untrusted(path, MAX_BYTES)
    if path.suffix != ".xacro":
        return data
    if importlib.util.find_spec("xacrodoc") is None:
        raise UserError(f"{path} is Xacro, which needs one more package: pip install 'xacrodoc>=2,<3'")
    return isolated(expand, f"Xacro {path}", b"", str(path), json.dumps(dict(arguments)), limit_s=XACRO_S)


def _flange(description: Description, flange: str | None) -> str:
    if flange is not None:
        if flange not in description.links:
            raise choices("link", flange, description.links)
        return flange
    leaves = sorted(description.links.keys() - {joint.parent for joint in description.joints.values()})
    if len(leaves) != 1:
        raise UsageError(f"which link bears tools? Choose it with robot.flange=LINK; possible: {', '.join(leaves[:9])}")
    return leaves[0]


def _arm(description: Description, flange: str, fixed: Sequence[str]) -> list[RobotJoint]:
    """List the joints that move between base and flange."""
    between = [description.joints[link] for link in description.above(flange)[-2::-1]]
    arm = [joint for joint in between if joint.kind != "fixed" and joint.name not in fixed]
    if not arm:
        raise UserError(f"no joint moves between base {description.root!r} and flange {flange!r}")
    return arm


def _turning(joint: RobotJoint) -> RobotJoint:
    """Check a joint of the arm, and give it finite limits."""
    where = f"joint {joint.name!r}"
    if joint.kind not in ("revolute", "continuous"):
        mend = f"an arm's joints turn; hold it at 0 with robot.fixed=[{joint.name}]"
        raise UserError(f"{where} between base and flange is {joint.kind}; {mend}")
    if joint.mimic:
        raise UserError(f"{where} between base and flange mimics another one, which can't be; drive each by itself")
    lower, upper = (-_TURN, _TURN) if joint.kind == "continuous" else _span(joint, "radians")
    limits = Limits(lower, upper, _limit(joint, "effort", "N m"), _limit(joint, "velocity", "rad/s"))
    return replace(joint, kind="revolute", limits=limits)


def _span(joint: RobotJoint, unit: str) -> tuple[float, float]:
    lower, upper = joint.range
    if not lower < upper:
        mend = f'give <limit lower="..." upper="..." effort="..." velocity="..."/>, {unit}'
        raise UserError(f"joint {joint.name!r} can't move: its limits are {lower:g} to {upper:g}; {mend}")
    return lower, upper


def _limit(joint: RobotJoint, name: str, unit: str) -> float:
    value: float | None = getattr(joint.limits, name)
    if value is None or value <= 0:
        found = "has no" if value is None else f"has {value:g} as"
        raise UserError(f"joint {joint.name!r} {found} {name} limit; take it from the arm's data sheet, {unit}")
    return value


def _home(home: Sequence[float], arm: Sequence[RobotJoint]) -> tuple[float, ...]:
    if len(home) != len(arm):
        names = ", ".join(joint.name for joint in arm)
        raise UsageError(f"home has {len(home)} numbers for {len(arm)} joints: {names}")
    for value, joint in zip(home, arm, strict=True):
        lower, upper = joint.range
        if not lower <= value <= upper:
            raise UsageError(f"home {value:g} of joint {joint.name!r} is not in its limits {lower:g} to {upper:g}")
    return tuple(float(value) for value in home)


def _gripper(
    description: Description, options: GripperOptions, flange: str, arm: Sequence[RobotJoint]
) -> tuple[Gripper, list[RobotJoint]]:
    """Check the gripper, whose mount is the flange's pose, and its two joints."""
    if options.link not in description.links:
        raise choices("link", options.link, description.links, "gripper")
    for name in options.joints:
        if name not in description.named:
            raise choices("joint", name, description.named, "gripper")
    left, right = (description.named[name] for name in options.joints)
    parts = description.rigid_parts(joint.child for joint in (*arm, left, right))
    (head, at), (same, mount) = parts[options.link], parts[flange]
    if head != same or options.link in description.above(flange):
        raise UserError(f"gripper link {options.link!r} must be fixed to flange {flange!r}, not before it")
    for joint in (left, right):
        if joint.kind != "prismatic" or options.link not in description.above(joint.child):
            raise UserError(f"joint {joint.name!r} is no prismatic joint on gripper link {options.link!r}")
    ways = [
        parts[joint.parent][1].rotation.apply(joint.origin.pose.rotation.apply(joint.direction))
        for joint in (left, right)
    ]
    if parts[left.parent][0] != parts[right.parent][0] or ways[0] @ ways[1] > -0.9:
        raise UserError(f"{left.name!r} and {right.name!r} don't move in opposite directions; turn one's axis around")
    spans = [_span(joint, "metres") for joint in (left, right) if not joint.mimic or joint.limits.upper]
    if not spans or any(lower != 0 for lower, _ in spans):
        raise UserError(f"{left.name!r} and {right.name!r} must move from 0, closed, to how far they open")
    driving = [joint for joint in (left, right) if not joint.mimic] or [left]
    travel = min(upper for _, upper in spans)
    force = options.force_n if options.force_n is not None else min(_limit(joint, "effort", "N") for joint in driving)
    if not 0 < force < math.inf or not 0 <= options.friction < math.inf:
        raise UsageError(f"gripper: force_n must be positive and friction 0 or more, got {force}, {options.friction}")
    limits = Limits(0.0, travel, force, min(_limit(joint, "velocity", "m/s") for joint in driving))
    links, joints = (left.child, right.child), (left.name, right.name)
    made = Gripper(options.link, at.inverse() @ mount, (options.link,), joints, links, travel, force, options.friction)
    return made, [replace(joint, limits=limits) for joint in (left, right)]


def _check_rest(description: Description, drives: Mapping[str, RobotJoint], fixed: Sequence[str]) -> None:
    """Refuse joints that would move by themselves."""
    joints = description.named
    for name in fixed:
        if name not in joints:
            raise choices("joint", name, joints, "fixed")
        lower, upper = joints[name].range
        if joints[name].kind != "continuous" and not min(lower, 0.0) == lower <= 0.0 <= upper:
            raise UserError(f"joint {name!r} can't be held at 0: its limits are {lower:g} to {upper:g}")
    for joint in joints.values():
        if joint.kind != "fixed" and joint.name not in drives and joint.name not in fixed:
            mend = f"hold it with robot.fixed=[{joint.name}], or leave out robot.without=[{joint.child}]"
            if joint.kind not in MOVING:
                mend = f"make it fixed, or leave out robot.without=[{joint.child}]"
            raise UserError(f"joint {joint.name!r} is {joint.kind}, and neither the arm's nor the gripper's; {mend}")


def _mount(robot: Robot, axis: Array, rpy: Sequence[float] | None) -> Pose:
    """Turn the mount on the flange, so that its axes at home are about the world's.

    ``axis`` (3,) is the last joint's in the flange's frame: a flange is square to it.
    """
    flange = Arm(robot).forward(np.array(robot.home))
    exact = flange.rotation.inv()
    if rpy is None:
        tilt = math.acos(min(1.0, abs(flange.rotation.apply(axis)[2])))
        if tilt > _TILT_RAD:
            found = f"at home the axis of {robot.arm_joints[-1]!r} is {math.degrees(tilt):.0f} degrees off the vertical"
            raise UserError(f"{found}; choose a home where the flange looks down, or turn the mount: robot.mount_rpy")
        turns = Rotation.create_group("O")  # by right angles
        turn = turns[int((turns.inv() * exact).magnitude().argmin())]
    elif len(rpy) != 3 or not all(map(math.isfinite, rpy)):
        raise UsageError(f"mount_rpy must be three finite numbers, got {list(rpy)}")
    else:
        turn = Rotation.from_euler("xyz", rpy)
    off = float((exact.inv() * turn).magnitude())
    if off > _TILT_RAD:
        found = f"at home the mount's axes are {math.degrees(off):.0f} degrees off the world's"
        same = short_numbers(Pose.from_rotation((0.0, 0.0, 0.0), exact).rpy, 4, ",")
        raise UserError(f"{found}; choose another home, or robot.mount_rpy=[{same}]")
    mount = Pose.from_rotation((0.0, 0.0, 0.0), turn)
    _check_looks_down(robot, flange @ mount)
    return mount


def _straightened(robot: Robot) -> Robot:
    """Turn the arm at home until the mount's axes are exactly the world's, at the same place."""
    arm = Arm(robot)
    solution = arm.inverse(Pose(arm.forward(arm.home).position), arm.home)
    if solution.error_m > 1e-3 or solution.error_rad > 1e-3:
        where = f"misses it by {solution.error_m:.3f} m and {solution.error_rad:.3f} rad"
        raise UserError(f"near home the arm can't turn the flange straight down: it {where}; choose another home")
    return replace(robot, home=tuple(solution.joints.round(6).tolist()))


def _check_looks_down(robot: Robot, mount: Pose) -> None:
    """Refuse a home at which the arm's last link lies below its flange."""
    poses = link_poses(robot, False, np.array(robot.home))
    heights = [
        float((mount.inverse() @ poses[solid.name]).apply(solid.bounds()[0])[2])
        for solid in robot_solids(robot, False)
        if solid.name in robot.near_mount
    ]
    if heights and max(heights) < -_UNDER_M:
        below = f"{-max(heights):.3f} m below flange {robot.mount_link!r}"
        raise UserError(f"at home the arm's last link is {below}, which looks up; choose a home where it looks down")

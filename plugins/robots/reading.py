"""Make a robot of a URDF file, of which the arm, its home and its flange are chosen."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import RIGID_MOUNT
from core.errors import UsageError, UserError, choices
from core.geometry import Array, Pose
from core.robot.description import RESERVED, write
from core.robot.kinematics import Arm, link_poses
from core.robot.solids import robot_solids
from core.support.files import read_untrusted
from core.support.text import clean, short_numbers
from core.values.descriptions import DIGITS, Description, Limits, Origin, RobotJoint
from core.values.robots import Gripper, Robot
from core.values.urdf import MAX_BYTES, read_description
from plugins.robots.normalise import Problems, normalised
from plugins.robots.settings import ArmSettings as ArmSettings
from plugins.robots.settings import BoltOptions as BoltOptions
from plugins.robots.settings import GripperOptions as GripperOptions

# A URDF has neither; each is a setting.
REACHES_SPEED_S = 0.5  # in which a joint reaches its speed limit; arms that are built in need 0.13 to 0.79 s
MOTOR_INERTIA = (
    0.1  # kg m^2, as MuJoCo Menagerie has it for arms that carry 3.5 to 12.5 kg
)

_TURN = (
    2 * math.pi
)  # a continuous joint turns this far each way: limits are finite everywhere
_TILT_RAD = 0.35  # at most between the mount's axes at home and the world's
_UNDER_M = 0.005  # of the middle of the link before the last joint: a flange that looks up is above it
_JOINTS = 7  # of an arm, at most
_NAMED = 20  # names that a message lists
TURNING = ("revolute", "continuous")


def read_robot(
    path: Path,
    home: Sequence[float] | None = None,
    flange: str | None = None,
    *,
    name: str = "urdf",
    **settings: Any,
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
    chosen = ArmSettings(
        path.expanduser().absolute(),
        None if home is None else list(home),
        flange,
        **settings,
    )
    description = describe(chosen)
    try:
        return mounted(*unmounted(description, chosen, name), chosen.mount_rpy)
    except UserError as error:
        raise type(error)(f"{chosen.path}: {error}") from error


def describe(chosen: ArmSettings) -> Description:
    """Read the description that is chosen.

    Raises:
        UserError: the file can't be used.
    """
    if chosen.path.suffix == ".xacro":
        made = chosen.path.with_suffix(
            "" if chosen.path.stem.endswith(".urdf") else ".urdf"
        ).name
        mend = f"pip install 'xacrodoc>=2,<3', then: xacrodoc {chosen.path} -o {made}"
        raise UserError(
            f"{chosen.path} is Xacro, of which a URDF is to be made first: {mend}"
        )
    data = read_untrusted(chosen.path, MAX_BYTES)
    return read_description(
        data, chosen.path, tuple(chosen.without or ()), taken=RESERVED
    )


def unmounted(
    description: Description,
    chosen: ArmSettings,
    name: str = "urdf",
    *,
    anywhere: bool = False,
) -> tuple[Robot, Array]:
    """Make a robot whose mount is the flange, as it is turned; and the last joint's axis (3,) in the flange's frame.

    With ``anywhere`` its home is in the middle of the joints' limits.

    Raises:
        UserError: names all that is wrong with the arm.
    """
    wrong = Problems()
    description = _held(description, chosen.fixed or {})
    link = _flange(description, chosen.flange)
    arm = [wrong.attempt(_turning, joint) or joint for joint in _arm(description, link)]
    middle = [sum(joint.range) / 2 for joint in arm]
    home = wrong.attempt(_home, middle if anywhere else chosen.home, arm) or tuple(
        middle
    )
    grip = None
    fingers = list[RobotJoint]()
    if chosen.gripper is not None and (
        found := wrong.attempt(_gripper, description, chosen.gripper, link, arm)
    ):
        grip, fingers = found
    drives = {joint.name: joint for joint in (*arm, *fingers)}
    if chosen.gripper is None or grip is not None:
        wrong.attempt(_check_rest, description, drives)
    parts = description.rigid_parts(joint.child for joint in arm)
    if not any(
        description.links[name].collisions
        for name, (head, _) in parts.items()
        if head != description.root
    ):
        wrong.append(
            UserError(
                "the arm has no collision shape; repeat each <visual> as <collision>: its hull counts"
            )
        )
    made = wrong.attempt(
        normalised, description, drives, link, [grip.link] if grip else []
    )
    wrong.report()
    assert made is not None
    speeds = [joint.limits.velocity or 0.0 for joint in arm]
    robot = Robot(
        name=name,
        title=chosen.title or clean(description.name, 60),
        urdf=write(made),
        arm_joints=tuple(joint.name for joint in arm),
        home=home,
        acceleration_limits=tuple(
            chosen.acceleration or (speed / REACHES_SPEED_S for speed in speeds)
        ),
        motor_inertia=tuple(chosen.motor_inertia or [MOTOR_INERTIA] * len(arm)),
        mount_link=link,
        mount=Pose(),
        near_mount=tuple(dict.fromkeys([parts[link][0], link])),
        payload_kg=chosen.payload_kg,
        gripper=grip,
        flange=(chosen.bolts or BoltOptions()).flange(),
    )
    return robot, parts[link][1].rotation.inv().apply(arm[-1].direction)


def mounted(robot: Robot, axis: Array, rpy: Sequence[float] | None) -> Robot:
    """Turn the mount of an `unmounted` robot as its home has it, and the arm in place until that is exactly upright.

    Raises:
        UserError: at home the flange does not look down (says which way it is off), or can't be turned so near there.
    """
    mount = _mount(robot, axis, rpy)
    grip = robot.gripper
    grip = None if grip is None else replace(grip, mount=grip.mount @ mount)
    robot = replace(robot, mount=mount, gripper=grip)
    arm = Arm(robot)
    solution = arm.inverse(Pose(arm.forward(arm.home).position), arm.home)
    if solution.error_m > 1e-3 or solution.error_rad > 1e-3:
        where = (
            f"misses it by {solution.error_m:.3f} m and {solution.error_rad:.3f} rad"
        )
        raise UserError(
            f"near home the arm can't turn the flange straight down: it {where}; choose another home"
        )
    return replace(robot, home=tuple(solution.joints.round(6).tolist()))


def _flange(description: Description, flange: str | None) -> str:
    if flange is not None:
        if flange not in description.links:
            raise choices("link", flange, description.links)
        return flange
    leaves = sorted(
        description.links.keys()
        - {joint.parent for joint in description.joints.values()}
    )
    if len(leaves) == 1:
        return leaves[0]
    turns = {
        link: sum(joint.kind in TURNING for joint in _between(description, link))
        for link in description.links
    }
    most = max((count for count in turns.values() if count <= _JOINTS), default=0)
    after = [
        (count, [link for link in description.links if turns[link] == count])
        for count in (most, most - 1)
    ]
    ends = "; ".join(
        f"after {count}: {', '.join(links[:_NAMED])}"
        for count, links in after
        if count > 0
    )
    raise UsageError(
        f"which link bears tools? Choose it with robot.flange=LINK; by the joints that turn, {ends}"
    )


def _between(description: Description, link: str) -> list[RobotJoint]:
    return [description.joints[below] for below in description.above(link)[-2::-1]]


def _held(
    description: Description, fixed: Sequence[str] | Mapping[str, float]
) -> Description:
    """Hold joints at values, radians or metres.

    Raises:
        UserError: there is no such joint, or a value is not in its limits.
    """
    joints = dict(description.joints)
    for name, value in (
        fixed if isinstance(fixed, Mapping) else dict.fromkeys(fixed, 0.0)
    ).items():
        if name not in description.named:
            raise choices("joint", name, description.named, "fixed")
        joint = description.named[name]
        (lower, upper), turns = joint.range, joint.kind in TURNING
        if not (
            math.isfinite(value)
            if joint.kind == "continuous"
            else lower <= value <= upper
        ):
            mend = f"give a value, robot.fixed={{{name}:{lower:g}}}"
            raise UserError(
                f"joint {name!r} can't be held at {value:g}: its limits are {lower:g} to {upper:g}; {mend}"
            )
        origin = joint.origin
        way = value * joint.direction
        if value:
            moved = (
                Pose.from_rotation((0.0, 0.0, 0.0), Rotation.from_rotvec(way))
                if turns
                else Pose(way)
            )
            origin = Origin.of(origin.pose @ moved, DIGITS)
        joints[joint.child] = replace(joint, kind="fixed", origin=origin, mimic=None)
    return replace(description, joints=joints)


def _arm(description: Description, flange: str) -> list[RobotJoint]:
    """List the joints that move between base and flange."""
    arm = [joint for joint in _between(description, flange) if joint.kind != "fixed"]
    if not arm:
        raise UserError(
            f"no joint moves between base {description.root!r} and flange {flange!r}"
        )
    return arm


def _turning(joint: RobotJoint) -> RobotJoint:
    """Check a joint of the arm, and give it finite limits."""
    where = f"joint {joint.name!r}"
    if joint.kind not in TURNING:
        mend = f"an arm's joints turn; hold it at a value with robot.fixed={{{joint.name}:{joint.range[0]:g}}}"
        raise UserError(f"{where} between base and flange is {joint.kind}; {mend}")
    if joint.mimic:
        raise UserError(
            f"{where} between base and flange mimics another one, which can't be; drive each by itself"
        )
    wrong = Problems()
    ends = (
        (-_TURN, _TURN)
        if joint.kind == "continuous"
        else wrong.attempt(_span, joint, "radians")
    )
    effort = wrong.attempt(_limit, joint, "effort", "N m")
    velocity = wrong.attempt(_limit, joint, "velocity", "rad/s")
    wrong.report()
    assert ends is not None
    return replace(joint, kind="revolute", limits=Limits(*ends, effort, velocity))


def _span(joint: RobotJoint, unit: str) -> tuple[float, float]:
    lower, upper = joint.range
    if not lower < upper:
        mend = (
            f'give <limit lower="..." upper="..." effort="..." velocity="..."/>, {unit}'
        )
        raise UserError(
            f"joint {joint.name!r} can't move: its limits are {lower:g} to {upper:g}; {mend}"
        )
    return lower, upper


def _limit(joint: RobotJoint, name: str, unit: str) -> float:
    value: float | None = getattr(joint.limits, name)
    if value is None or value <= 0:
        found = "has no" if value is None else f"has {value:g} as"
        raise UserError(
            f"joint {joint.name!r} {found} {name} limit; take it from the arm's data sheet, {unit}"
        )
    return value


def _home(home: Sequence[float] | None, arm: Sequence[RobotJoint]) -> tuple[float, ...]:
    if home is None:
        raise UsageError(
            "robot.home is needed, at which the flange looks down; `vlmgineer home` with these words finds it"
        )
    if len(home) != len(arm):
        names = ", ".join(joint.name for joint in arm)
        raise UsageError(f"home has {len(home)} numbers for {len(arm)} joints: {names}")
    for value, joint in zip(home, arm, strict=True):
        lower, upper = joint.range
        if not lower <= value <= upper:
            raise UsageError(
                f"home {value:g} of joint {joint.name!r} is not in its limits {lower:g} to {upper:g}"
            )
    return tuple(float(value) for value in home)


def _gripper(
    description: Description,
    options: GripperOptions,
    flange: str,
    arm: Sequence[RobotJoint],
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
        raise UserError(
            f"gripper link {options.link!r} must be fixed to flange {flange!r}, not before it"
        )
    for joint in (left, right):
        if joint.kind != "prismatic" or options.link not in description.above(
            joint.child
        ):
            raise UserError(
                f"joint {joint.name!r} is no prismatic joint on gripper link {options.link!r}"
            )
    ways = [
        parts[joint.parent][1].rotation.apply(
            joint.origin.pose.rotation.apply(joint.direction)
        )
        for joint in (left, right)
    ]
    if parts[left.parent][0] != parts[right.parent][0] or ways[0] @ ways[1] > -0.9:
        raise UserError(
            f"{left.name!r} and {right.name!r} don't move in opposite directions; turn one's axis around"
        )
    spans = [
        _span(joint, "metres")
        for joint in (left, right)
        if not joint.mimic or joint.limits.upper
    ]
    if not spans or any(lower != 0 for lower, _ in spans):
        raise UserError(
            f"{left.name!r} and {right.name!r} must move from 0, closed, to how far they open"
        )
    driving = [joint for joint in (left, right) if not joint.mimic] or [left]
    travel = min(upper for _, upper in spans)
    force = (
        options.force_n
        if options.force_n is not None
        else min(_limit(joint, "effort", "N") for joint in driving)
    )
    if not 0 < force < math.inf or not 0 <= options.friction < math.inf:
        raise UsageError(
            f"gripper: force_n must be positive and friction 0 or more, got {force}, {options.friction}"
        )
    limits = Limits(
        0.0, travel, force, min(_limit(joint, "velocity", "m/s") for joint in driving)
    )
    links = (left.child, right.child)
    joints = (left.name, right.name)
    made = Gripper(
        options.link,
        at.inverse() @ mount,
        (options.link,),
        joints,
        links,
        travel,
        force,
        options.friction,
    )
    return made, [replace(joint, limits=limits) for joint in (left, right)]


def _check_rest(description: Description, drives: Mapping[str, RobotJoint]) -> None:
    """Refuse joints that would move by themselves."""
    moving = [
        joint
        for joint in description.joints.values()
        if joint.kind != "fixed" and joint.name not in drives
    ]
    if not moving:
        return
    below = {joint.child for joint in moving}
    tops = [
        joint.child
        for joint in moving
        if not below & {*description.above(joint.child)[1:]}
    ]
    values = {
        joint.name: min(max(joint.range[0], 0.0), joint.range[1]) for joint in moving
    }
    held = f"[{','.join(values)}]"
    if any(values[joint.name] for joint in moving if joint.kind != "continuous"):
        held = f"{{{','.join(f'{name}:{value:g}' for name, value in values.items())}}}"
    found = ", ".join(f"{joint.name!r} is {joint.kind}" for joint in moving[:3])
    others = f" and {len(moving) - 3} others move" if len(moving) > 3 else ""
    beside = f"joint {found}{others}, and neither the arm's nor the gripper's"
    raise UserError(
        f"{beside}; hold with robot.fixed={held}, or leave out robot.without=[{','.join(tops)}]"
    )


def _mount(robot: Robot, axis: Array, rpy: Sequence[float] | None) -> Pose:
    """Turn the mount on the flange, so that its axes at home are about the world's.

    ``axis`` (3,) is the last joint's in the flange's frame: a flange is square to it.
    """
    flange = Arm(robot).forward(np.array(robot.home))
    exact = flange.rotation.inv()
    if rpy is None:
        tilt = math.acos(min(1.0, abs(flange.rotation.apply(axis)[2])))
        if tilt > _TILT_RAD:
            along = flange.rotation.apply(axis) * np.sign(
                flange.rotation.apply(axis)[2] or 1.0
            )
            way = _way(Rotation.align_vectors([(0.0, 0.0, 1.0)], [along])[0])
            found = f"at home the axis of {robot.arm_joints[-1]!r} is {math.degrees(tilt):.0f} degrees off the vertical"
            mend = "or choose a home where the flange looks down (vlmgineer home), or turn the mount: robot.mount_rpy"
            raise UserError(f"{found}; {way}, {mend}")
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
        raise UserError(
            f"{found}; {_way((flange.rotation * turn).inv())}, or set robot.mount_rpy=[{same}]"
        )
    if (height := wrist_height(robot, np.array(robot.home))) < -_UNDER_M:
        below = f"the link before {robot.arm_joints[-1]!r} is {-height:.3f} m below flange {robot.mount_link!r}"
        raise UserError(
            f"at home {below}, which looks up; choose a home where it looks down (vlmgineer home)"
        )
    return Pose.from_rotation((0.0, 0.0, 0.0), turn)


def _way(rotation: Rotation) -> str:
    """Say how the flange has to turn in the world."""
    way = rotation.as_rotvec()
    angle = float(np.linalg.norm(way))
    axis = short_numbers(way / angle, 2, ", ")
    return f"turn the flange by {math.degrees(angle):.0f} degrees about the world's axis ({axis})"


def wrist_height(robot: Robot, joints: Array) -> float:
    """Measure how far above the mount, along the last joint, the middle of the link before that joint is, metres.

    Of a flange that looks down it is above, whatever the flange's own shape and frame. 0: no link has a shape.
    """
    poses = link_poses(robot, False, joints)
    shapes = robot_solids(robot, False)
    last = robot.description.named[robot.arm_joints[-1]]
    mount = poses[RIGID_MOUNT]
    for link in robot.description.above(last.parent):
        if middles := [
            poses[link].apply(solid.bounds()[0])
            for solid in shapes
            if solid.name == link
        ]:
            along = poses[last.child].rotation.apply(last.direction)
            return float((np.mean(middles, axis=0) - mount.position) @ along * along[2])
    return 0.0

"""Choose the arm in a description: its flange, its joints, its gripper, and what is held."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from core.errors import Problems, UsageError, UserError, choices
from core.geometry import Array, Pose
from core.imports.kinds import find_fingers
from core.interfaces import Gripper
from core.values.descriptions import (
    DIGITS,
    MOVING,
    Description,
    Limits,
    Origin,
    RobotJoint,
)
from plugins.robots.arm_settings import ArmSettings, GripperOptions
from plugins.robots.completing import complete
from plugins.robots.foreign_names import (
    names_jaw,
    names_sensor,
    names_tool_frame,
    write_word,
)

# Where limits that a file lacks are given.
_TURNING = {
    "effort": "N m: robot.effort=[...], a number for each joint or one for all",
    "velocity": "rad/s: robot.velocity=[...], a number for each joint or one for all",
}
_SLIDING = {
    "effort": "N: robot.effort=[...], a number for each joint",
    "velocity": "m/s: robot.velocity=[...], a number for each joint",
}
_FINGER = {
    "effort": "N: robot.gripper with force_n",
    "velocity": 'm/s: its <limit velocity="...">',
}
TURNING = ("revolute", "continuous")
_TURN = 2 * math.pi  # a continuous joint turns so far each way: limits are finite
_MOST_JOINTS = 7  # of an arm
_LEAST_JOINTS = 2
_NAMED = 20  # names that a message lists
# A joint that turns no farther, from about here, may open a jaw.
_JAW_RAD = 2.4
_CLOSED_RAD = 0.35
_OPENS_RAD = 0.13  # at least: limits of less are missing, or in other units


@dataclass(frozen=True)
class ArmParts:
    """The arm in a description, and all that was wrong with it.

    Attributes:
        description: of the whole robot, as it is held and filled in; only the arm and the gripper move.
        flange: the link that bears tools.
        joints: of the arm, with finite limits.
        home: a value for each, if one was given.
        gripper: if one was chosen.
        wrong: what was wrong.
    """

    description: Description
    flange: str
    joints: list[RobotJoint]
    home: tuple[float, ...] | None
    gripper: Gripper | None
    wrong: Problems


def choose_arm(
    description: Description, chosen: ArmSettings, notes: list[str], *, anywhere: bool
) -> ArmParts:
    """Choose the arm in a description; with ``anywhere`` its home is in the middle of the joints' limits.

    Raises:
        UserError: there is no such flange, or none that is plain.
    """
    wrong = Problems()
    description = hold_joints(description, chosen.fixed or {})
    flange = choose_flange(description, chosen.flange, notes)
    description = complete(description, chosen, notes)
    driven = find_arm(description, flange)
    driven = set_limits(driven, "velocity", chosen.velocity)
    driven = set_limits(driven, "effort", chosen.effort)
    arm = [wrong.attempt(limit_joint, joint) or joint for joint in driven]
    middle = tuple(sum(joint.range) / 2 for joint in arm)
    home = wrong.attempt(check_home, middle if anywhere else chosen.home, arm)

    gripper = None
    fingers = list[RobotJoint]()
    if chosen.gripper is not None:
        found = wrong.attempt(choose_gripper, description, chosen.gripper, flange, arm)
        if found is not None:
            gripper, fingers = found

    drives = {joint.name: joint for joint in (*arm, *fingers)}
    if chosen.gripper is None or gripper is not None:
        wrong.attempt(check_rest, description, drives)

    parts = description.rigid_parts(joint.child for joint in arm)
    moving = [name for name, (head, _) in parts.items() if head != description.root]
    if not any(description.links[link].collisions for link in moving):
        wrong.append(
            UserError(
                "the arm has no collision shape; let it collide as it is drawn, robot.collision=visual, or repeat each "
                "<visual> as <collision>: its hull counts"
            )
        )

    joints = {
        child: drives.get(joint.name) or replace(joint, kind="fixed")
        for child, joint in description.joints.items()
    }
    description = replace(description, joints=joints)
    return ArmParts(description, flange, arm, home, gripper, wrong)


def hold_joints(
    description: Description, fixed: Sequence[str] | Mapping[str, float]
) -> Description:
    """Hold joints at values, radians or metres.

    Raises:
        UserError: there is no such joint, or a value is not in its limits.
    """
    if not isinstance(fixed, Mapping):
        fixed = dict.fromkeys(fixed, 0.0)

    joints = dict(description.joints)
    for name, value in fixed.items():
        if name not in description.named:
            raise choices("joint", name, description.named, "fixed")

        joint = description.named[name]
        lower, upper = joint.range

        possible = lower <= value <= upper
        if joint.kind == "continuous":
            possible = math.isfinite(value)
        if not possible:
            raise UserError(
                f"joint {name!r} can't be held at {value:g}: its limits are {lower:g} to {upper:g}; give a value, "
                f"{write_word('fixed', {name: lower})}"
            )

        origin = joint.origin
        if value:
            origin = Origin.from_pose(origin.pose @ joint.moved(value), DIGITS)

        joints[joint.child] = replace(joint, kind="fixed", origin=origin, mimic=None)

    return replace(description, joints=joints)


def choose_flange(
    description: Description, flange: str | None, notes: list[str]
) -> str:
    """Return the link that bears tools; None: the only one that bears no other, if that is no jaw.

    Raises:
        UserError: there is no such link, or several could be meant; names them.
    """
    if flange is not None:
        if flange not in description.links:
            raise choices("link", flange, description.links)
        return flange

    parents = {joint.parent for joint in description.joints.values()}
    leaves = sorted(description.links.keys() - parents)
    if len(leaves) == 1:
        _refuse_jaw(description, leaves[0])
        note = (
            f"tools are bolted to {leaves[0]!r}, as no other link hangs on it; "
            f"{write_word('flange', leaves[0])} says so"
        )
        borne = description.joints.get(leaves[0])
        if borne is not None and borne.kind != "fixed":
            note += (
                f"; if it is a gripper's jaw, {write_word('flange', borne.parent)} "
                f"{write_word('without', leaves)}"
            )

        notes.append(note)
        return leaves[0]

    fingers = find_fingers(description) or ()
    # Links by the number of joints that turn them, or of slides where none does.
    after: dict[int, list[str]] = {}
    for link in description.links:
        before = joints_before(description, link)
        moving = [joint for joint in before if joint.kind in MOVING]
        turning = [joint for joint in moving if joint.kind in TURNING]
        if not any(joint.name in fingers for joint in moving):
            after.setdefault(len(turning or moving), []).append(link)

    most = max((count for count in after if count <= _MOST_JOINTS), default=0)
    ends = []
    for count in (most, most - 1):
        if count > 0:
            named = sorted(after[count], key=_rate_flange)
            ends.append(f"after {count}: {', '.join(named[:_NAMED])}")

    raise UsageError(
        f"which link bears tools? Choose it with robot.flange=LINK; by the joints that turn, {'; '.join(ends)}"
    )


def _rate_flange(link: str) -> int:
    """Rate how likely a link bears tools by its name, the lowest first: tools' frames, others, sensors."""
    if names_tool_frame(link):
        return 0

    return 2 if names_sensor(link) else 1


def _refuse_jaw(description: Description, leaf: str) -> None:
    """Refuse the only link that bears no other where it may be a gripper's jaw.

    Raises:
        UsageError: asks, with both answers.
    """
    moving = [j for j in joints_before(description, leaf) if j.kind != "fixed"]
    if len(moving) < 2:
        return

    last = moving[-1]
    lower, upper = last.range
    reasons = {
        "by its name": names_jaw(leaf, last.name, last.child),
        f"as joint {last.name!r} is {last.kind}": last.kind not in TURNING,
        f"as joint {last.name!r} mimics another one": last.mimic,
        f"as joint {last.name!r} opens from about 0 by {upper - lower:.2g} rad": (
            last.kind == "revolute"
            and _OPENS_RAD < upper - lower < _JAW_RAD
            and min(abs(lower), abs(upper)) < _CLOSED_RAD
        ),
    }
    found = [reason for reason, speaks in reasons.items() if speaks]
    if found:
        raise UsageError(
            f"which link bears tools? {leaf!r}, the only one that bears no other, may be a gripper's jaw, {found[0]}: "
            f"if so, {write_word('flange', last.parent)} {write_word('without', [last.child])}; if not, "
            f"{write_word('flange', leaf)}"
        )


def joints_before(description: Description, link: str) -> list[RobotJoint]:
    """List the joints between the base and a link."""
    return [description.joints[child] for child in description.above(link)[-2::-1]]


def find_arm(description: Description, flange: str) -> list[RobotJoint]:
    """List the joints that move between base and flange."""
    between = joints_before(description, flange)
    arm = [joint for joint in between if joint.kind != "fixed"]
    if len(arm) < _LEAST_JOINTS:
        raise UserError(
            f"{len(arm) or 'no'} joint moves between base {description.root!r} and flange {flange!r}; an arm has "
            f"{_LEAST_JOINTS} or more"
        )

    return arm


def set_limits(
    arm: Sequence[RobotJoint],
    name: str,
    values: float | Sequence[float] | None,
) -> list[RobotJoint]:
    """Set the limit of ``velocity`` or ``effort`` of all joints or of each; None: the file's stay.

    Raises:
        UsageError: there is another number of joints.
    """
    if values is None:
        return list(arm)
    if isinstance(values, float | int):
        values = [values] * len(arm)
    if len(values) != len(arm):
        raise UsageError(
            f"robot.{name} has {len(values)} numbers for {len(arm)} joints: {_list_names(arm)}"
        )

    return [
        replace(joint, limits=joint.limits._replace(**{name: value}))
        for joint, value in zip(arm, values, strict=True)
    ]


def _list_names(arm: Sequence[RobotJoint]) -> str:
    return ", ".join(joint.name for joint in arm)


def limit_joint(joint: RobotJoint) -> RobotJoint:
    """Check a joint of the arm, and give it finite limits."""
    where = f"joint {joint.name!r} between base and flange"

    if joint.kind not in MOVING:
        raise UserError(
            f"{where} is {joint.kind}; an arm's joints turn or slide; hold it with {write_word('fixed', [joint.name])}"
        )

    if joint.mimic:
        raise UserError(
            f"{where} mimics another one, which can't be; drive each by itself"
        )

    wrong = Problems()
    ends: tuple[float, float] | None = (-_TURN, _TURN)
    if joint.kind != "continuous":
        ends = wrong.attempt(read_span, joint)

    effort = wrong.attempt(read_limit, joint, "effort")
    velocity = wrong.attempt(read_limit, joint, "velocity")
    wrong.report()
    assert ends is not None

    kind = "prismatic" if joint.kind == "prismatic" else "revolute"
    return replace(joint, kind=kind, limits=Limits(*ends, effort, velocity))


def read_span(joint: RobotJoint) -> tuple[float, float]:
    """Return the range of a joint that moves."""
    lower, upper = joint.range
    if not lower < upper:
        unit = "radians" if joint.kind in TURNING else "metres"
        raise UserError(
            f"joint {joint.name!r} can't move: its limits are {lower:g} to {upper:g}; "
            f'give <limit lower="..." upper="..." effort="..." velocity="..."/>, {unit}'
        )

    return lower, upper


def read_limit(joint: RobotJoint, name: str, *, finger: bool = False) -> float:
    """Return the limit of effort or velocity of a joint that is driven, of the arm or a finger."""
    value: float | None = getattr(joint.limits, name)
    if value is None or value <= 0:
        found = "has no" if value is None else f"has {value:g} as"
        mends = _TURNING if joint.kind in TURNING else _SLIDING
        mend = (_FINGER if finger else mends)[name]
        raise UserError(
            f"joint {joint.name!r} {found} {name} limit; take it from the arm's data sheet, {mend}"
        )

    return value


def check_home(
    home: Sequence[float] | None, arm: Sequence[RobotJoint]
) -> tuple[float, ...]:
    """Return the home, a value within its limits for each of the arm's joints."""
    if home is None:
        raise UsageError(
            "robot.home is needed, at which the flange looks down; vlmgineer import FILE with the other words finds it"
        )

    if len(home) != len(arm):
        raise UsageError(
            f"home has {len(home)} numbers for {len(arm)} joints: {_list_names(arm)}"
        )

    for value, joint in zip(home, arm, strict=True):
        lower, upper = joint.range
        if not lower <= value <= upper:
            raise UsageError(
                f"home {value:g} of joint {joint.name!r} is not in its limits {lower:g} to {upper:g}"
            )

    return tuple(map(float, home))


def choose_gripper(
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

    fingers = (left, right)
    parts = description.rigid_parts(joint.child for joint in (*arm, *fingers))
    head, in_head = parts[options.link]
    flange_head, flange_in_head = parts[flange]
    if head != flange_head or options.link in description.above(flange):
        raise UserError(
            f"gripper link {options.link!r} must be fixed to flange {flange!r}, not before it"
        )

    for joint in fingers:
        borne = options.link in description.above(joint.child)
        if joint.kind != "prismatic" or not borne:
            raise UserError(
                f"joint {joint.name!r} is no prismatic joint on gripper link {options.link!r}"
            )

    same_body = parts[left.parent][0] == parts[right.parent][0]
    if not same_body or _slide(left, parts) @ _slide(right, parts) > -0.9:
        raise UserError(
            f"{left.name!r} and {right.name!r} don't move in opposite directions; turn one's axis around"
        )

    limits = _finger_limits(fingers, options)
    gripper = Gripper(
        link=options.link,
        mount=in_head.inverse() @ flange_in_head,
        near_mount=(options.link,),
        joints=(left.name, right.name),
        links=(left.child, right.child),
        travel_m=limits.upper or 0.0,
        force_n=limits.effort or 0.0,
        friction=options.friction,
    )
    return gripper, [replace(joint, limits=limits) for joint in fingers]


def _slide(joint: RobotJoint, parts: Mapping[str, tuple[str, Pose]]) -> Array:
    """Return the direction (3,) in which a finger slides, in the frame of the rigid part that bears it."""
    _, bearer = parts[joint.parent]
    way = joint.origin.pose.rotation.apply(joint.direction)
    return np.asarray(bearer.rotation.apply(way))


def _finger_limits(fingers: Sequence[RobotJoint], options: GripperOptions) -> Limits:
    """Return the limits of both fingers, which open from 0, closed, to as far as both can."""
    left, right = fingers
    opening = []
    for joint in fingers:
        if not joint.mimic or joint.limits.upper:
            opening.append(read_span(joint))

    if not opening or any(lower != 0 for lower, _ in opening):
        raise UserError(
            f"{left.name!r} and {right.name!r} must move from 0, closed, to how far they open"
        )

    driving = [joint for joint in fingers if not joint.mimic] or [left]
    force = options.force_n
    if force is None:
        force = min(read_limit(joint, "effort", finger=True) for joint in driving)
    if not 0 < force < math.inf or not 0 <= options.friction < math.inf:
        raise UsageError(
            f"gripper: force_n must be positive and friction 0 or more, got {force}, {options.friction}"
        )

    speed = min(read_limit(joint, "velocity", finger=True) for joint in driving)
    return Limits(0.0, min(upper for _, upper in opening), force, speed)


def check_rest(description: Description, drives: Iterable[str]) -> None:
    """Refuse joints that would move by themselves: all that are neither fixed nor among ``drives``.

    Raises:
        UserError: names them, and the words that hold them or leave out what they bear.
    """
    free = {
        joint.child: joint
        for joint in description.joints.values()
        if joint.kind != "fixed" and joint.name not in drives
    }
    if not free:
        return

    tops = [link for link in free if not free.keys() & {*description.above(link)[1:]}]
    values = {}
    for joint in free.values():
        lower, upper = joint.range
        values[joint.name] = round(min(max(lower, 0.0), upper), 6)

    kinds = [f"{joint.name!r} is {joint.kind}" for joint in free.values()]
    found = ", ".join(kinds[:3])
    if len(kinds) > 3:
        found += f" and {len(kinds) - 3} others move"

    raise UserError(
        f"beside joint {found}, and neither the arm's nor the gripper's; hold with "
        f"{write_word('fixed', values)}, or leave out {write_word('without', tops)}"
    )

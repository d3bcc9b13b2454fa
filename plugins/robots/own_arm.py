"""Make a robot of a URDF or MJCF file, of which the arm, its home and its flange are chosen."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from multiprocessing import parent_process
from pathlib import Path
from typing import Any

from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import Gripper, Robot
from core.support.cli import expand
from core.support.text import clean
from core.values.descriptions import Description, RobotJoint
from plugins.robots.arm_files import read_arm
from plugins.robots.arm_settings import ArmSettings, BoltOptions
from plugins.robots.arm_warnings import find_warnings
from plugins.robots.choosing import choose_arm
from plugins.robots.enlarging import describe_factor, enlarge, find_factor
from plugins.robots.foreign_names import choose_all_names
from plugins.robots.normalise import normalise, read_meshes
from plugins.robots.turned_mount import turn_mount

_log = logging.getLogger(__name__)

# A URDF has neither; each is a setting.
REACHES_SPEED_S = 0.5  # in which a joint reaches its speed limit; arms that are built in need 0.13 to 0.79 s
# kg m^2, as MuJoCo Menagerie has it for arms that carry 3.5 to 12.5 kg.
MOTOR_INERTIA = 0.1
STRONG = 28.0  # N m, of the weakest motor there


@dataclass(frozen=True)
class Unmounted:
    """An arm whose mount is the flange, as it is turned.

    Attributes:
        robot: with names that every engine reads.
        axis: the last joint's (3,) in the flange's frame.
        description: as the file has it.
        flange: the link's name in the file.
        joints: the arm's joints, by their names in the file.
        notes: what was assumed or left out, and what is hardly meant, a line each.
    """

    robot: Robot
    axis: Array
    description: Description
    flange: str
    joints: tuple[str, ...]
    notes: list[str]


def read_robot(
    path: Path,
    home: Sequence[float] | None = None,
    flange: str | None = None,
    *,
    name: str = "",
    **settings: Any,
) -> Robot:
    """Make a robot of a file. Its base is the only link that has no parent.

    Args:
        path: see `ArmSettings`, as for ``home`` and ``flange``.
        home: see there.
        flange: see there.
        name: the robot's; empty: its title.
        settings: the others of `ArmSettings`.

    Raises:
        UserError: the file or something in it can't be used; says what, where, and how to mend it.
    """
    path = expand(path).absolute()
    if home is not None:
        home = list(home)

    chosen = ArmSettings(path, home, flange, **settings)
    description, notes = read_arm(chosen)
    factor = find_factor(chosen.reach)
    try:
        arm = build_unmounted(description, notes, chosen, name)
        if factor != 1:
            arm.notes.append(describe_factor(factor))

        robot = turn_mount(
            arm.robot, arm.axis, chosen.mount_rpy, chosen.face_m, arm.notes
        )
        if parent_process() is None:  # workers stay silent
            for note in arm.notes:
                _log.warning("%s: %s", chosen.path, note)
    except UserError as error:
        raise type(error)(f"{chosen.path}: {error}") from error

    if factor != 1:
        robot = enlarge(robot, factor)

    return robot


def build_unmounted(
    description: Description,
    notes: list[str],
    chosen: ArmSettings,
    name: str = "",
    *,
    anywhere: bool = False,
) -> Unmounted:
    """Make a robot of what `read_arm` read, whose mount is the flange, as it is turned.

    With ``anywhere`` its home is in the middle of the joints' limits.

    Raises:
        UserError: names all that is wrong with the arm; then all that is wrong with its meshes.
    """
    parts = choose_arm(description, chosen, notes, anywhere=anywhere)
    arm = parts.joints
    gripper = parts.gripper
    flange = parts.flange
    detached = [] if gripper is None else [gripper.link]
    whole = parts.wrong.attempt(normalise, parts.description, flange, detached)
    parts.wrong.report()
    assert whole is not None
    assert parts.home is not None
    whole = read_meshes(whole, notes)
    notes += find_warnings(parts.description, arm, whole)

    head, in_head = parts.description.rigid_parts(joint.child for joint in arm)[flange]
    links, joints = choose_all_names(whole, notes)
    if gripper is not None:
        gripper = _rename_gripper(gripper, links, joints)

    speeds = [joint.limits.velocity or 0.0 for joint in arm]
    accelerations = chosen.acceleration or [speed / REACHES_SPEED_S for speed in speeds]
    motors = [joint.armature or _guess_motor(joint) for joint in arm]
    title = chosen.title or clean(description.name, 60)
    robot = Robot(
        name=name or title,
        title=title,
        description=whole.renamed(links, joints),
        arm_joints=tuple(joints[joint.name] for joint in arm),
        home=parts.home,
        acceleration_limits=tuple(accelerations),
        motor_inertia=tuple(chosen.motor_inertia or motors),
        mount_link=links[flange],
        mount=Pose(),
        near_mount=tuple(dict.fromkeys([links[head], links[flange]])),
        payload_kg=chosen.payload_kg,
        gripper=gripper,
        flange=(chosen.bolts or BoltOptions()).flange(),
    )
    axis = in_head.rotation.inv().apply(arm[-1].direction)
    names = tuple(joint.name for joint in arm)
    return Unmounted(robot, axis, description, flange, names, notes)


def _guess_motor(joint: RobotJoint) -> float:
    """Guess the inertia of a motor by its torque: weak ones are small, and a slide gets none."""
    if joint.kind == "prismatic":
        return 0.0

    return MOTOR_INERTIA * min(1.0, (joint.limits.effort or 0.0) / STRONG)


def _rename_gripper(
    gripper: Gripper, links: dict[str, str], joints: dict[str, str]
) -> Gripper:
    fingers: Any = tuple(links[link] for link in gripper.links)
    slides: Any = tuple(joints[joint] for joint in gripper.joints)
    return replace(
        gripper,
        link=links[gripper.link],
        near_mount=(links[gripper.link],),
        joints=slides,
        links=fingers,
    )

"""Make a robot of a URDF file, of which the arm, its home and its flange are chosen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import Robot
from core.robot.description import RESERVED
from core.robot.writing import write
from core.support.files import read_untrusted
from core.support.text import clean
from core.values.descriptions import Description, RobotJoint
from core.values.urdf import MAX_BYTES, read_description
from plugins.robots.choosing import (
    check_home,
    check_rest,
    choose_flange,
    choose_gripper,
    find_arm,
    hold_joints,
    limit_turning,
)
from plugins.robots.mounting import turn_mount
from plugins.robots.normalise import Problems, normalise
from plugins.robots.settings import ArmSettings, BoltOptions

# A URDF has neither; each is a setting.
REACHES_SPEED_S = 0.5  # in which a joint reaches its speed limit; arms that are built in need 0.13 to 0.79 s
# kg m^2, as MuJoCo Menagerie has it for arms that carry 3.5 to 12.5 kg.
MOTOR_INERTIA = 0.1


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
    path = path.expanduser().absolute()
    if home is not None:
        home = list(home)
    chosen = ArmSettings(path, home, flange, **settings)
    description = describe(chosen)
    try:
        return turn_mount(*build_unmounted(description, chosen, name), chosen.mount_rpy)
    except UserError as error:
        raise type(error)(f"{chosen.path}: {error}") from error


def describe(chosen: ArmSettings) -> Description:
    """Read the description that is chosen.

    Raises:
        UserError: the file can't be used.
    """
    path = chosen.path
    if path.suffix == ".xacro":
        suffix = "" if path.stem.endswith(".urdf") else ".urdf"
        raise UserError(
            f"{path} is Xacro, of which a URDF is to be made first: pip install 'xacrodoc>=2,<3', then: "
            f"xacrodoc {path} -o {path.with_suffix(suffix).name}"
        )

    data = read_untrusted(path, MAX_BYTES)
    return read_description(data, path, chosen.without or (), taken=RESERVED)


def build_unmounted(
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
    description = hold_joints(description, chosen.fixed or {})
    flange = choose_flange(description, chosen.flange)

    arm = []
    for joint in find_arm(description, flange):
        arm.append(wrong.attempt(limit_turning, joint) or joint)
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
                "the arm has no collision shape; repeat each <visual> as <collision>: its hull counts"
            )
        )

    detached = [] if gripper is None else [gripper.link]
    whole = wrong.attempt(normalise, description, drives, flange, detached)
    wrong.report()
    assert whole is not None
    assert home is not None

    speeds = [joint.limits.velocity or 0.0 for joint in arm]
    accelerations = chosen.acceleration or [speed / REACHES_SPEED_S for speed in speeds]
    robot = Robot(
        name=name,
        title=chosen.title or clean(description.name, 60),
        urdf=write(whole),
        arm_joints=tuple(joint.name for joint in arm),
        home=home,
        acceleration_limits=tuple(accelerations),
        motor_inertia=tuple(chosen.motor_inertia or [MOTOR_INERTIA] * len(arm)),
        mount_link=flange,
        mount=Pose(),
        near_mount=tuple(dict.fromkeys([parts[flange][0], flange])),
        payload_kg=chosen.payload_kg,
        gripper=gripper,
        flange=(chosen.bolts or BoltOptions()).flange(),
    )
    _, in_head = parts[flange]
    return robot, in_head.rotation.inv().apply(arm[-1].direction)

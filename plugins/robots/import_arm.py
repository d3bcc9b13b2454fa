"""Take an arm's file: find joints at which its flange looks down, and the words that use it."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import DictConfig, OmegaConf

from core.config.compose import load, part
from core.design import GRIPPER_MOUNTS, RIGID_MOUNT
from core.errors import UsageError, UserError
from core.geometry import Pose
from core.hooks import Taken
from core.imports.documents import MAX_BYTES, read_root
from core.imports.kinds import find_fingers
from core.imports.urdf import read_tree
from core.interfaces import Robot
from core.plugins import ROBOT
from core.plugins.registry import check_settings
from core.robot.kinematics import arm_of, link_poses
from core.support.files import read_untrusted
from core.support.text import hydra_word, short_numbers
from core.values.descriptions import Description
from plugins.robots.arm_files import read_arm
from plugins.robots.arm_settings import ArmSettings, GripperOptions
from plugins.robots.choosing import choose_flange
from plugins.robots.enlarging import describe_factor, find_factor
from plugins.robots.foreign_names import write_word
from plugins.robots.home_search import (
    HOME_DIGITS,
    find_for_tasks,
    find_home,
    measure_depth,
)
from plugins.robots.own_arm import Unmounted, build_unmounted
from plugins.robots.turned_mount import START
from plugins.robots.urdf import urdf

_BEYOND_M = 1e-3  # what reaches less beyond the mount is nothing


def take_arm(_file: Path, cfg: DictConfig) -> Taken:
    """Find joints at which the flange of one's own arm looks down, and the words that use it.

    Args:
        _file: the arm's, which is a setting of ``robot=urdf``, too.
        cfg: with ``robot``, and ``at``.

    Raises:
        UserError: something is wrong with the arm; names all of it.
    """
    named = part(ROBOT, cfg.robot)
    if named.name != "urdf":
        raise UsageError(f"robot={named.name} is built in; leave robot= away")

    at = cfg.at
    if at is not None and not (len(at) == 3 and all(map(math.isfinite, at))):
        raise UsageError(f"at must be three numbers, metres, got {at}")

    settings = dict(named.settings)
    chosen = ArmSettings(**check_settings(urdf, settings, "robot=urdf", {}))
    factor = find_factor(chosen.reach)
    try:
        description, notes = read_arm(chosen)
        chosen, hand = _take_hand(description, chosen, notes)
        arm = build_unmounted(description, notes, chosen, anywhere=True)
        if at is None and chosen.reach is None and not any(named.base):
            found = find_for_tasks(arm, chosen)
        else:
            place = named.pose.inverse().apply(np.array(at or START))
            found = replace(find_home(arm, chosen, place / factor), factor=factor)
    except UserError as error:  # a line for each problem
        problems = map(str, error.problems or [error])
        raise type(error)("\n- ".join(problems)) from error

    lines = list(arm.notes)
    if found.factor != 1:
        lines.append(describe_factor(found.factor))

    home = arm_of(found.robot).home
    place = named.pose.apply(found.factor * arm_of(found.robot).forward(home).position)
    place[2] += found.lift_m
    home_word = f"robot.home=[{short_numbers(home, HOME_DIGITS, ',')}]"
    lines += [
        f"the flange {arm.flange!r}, borne by {', '.join(arm.joints)}, is at "
        f"({short_numbers(place, 3, ', ')}) and looks down",
        home_word,
        *hand,
        *found.words,
    ]
    if found.robot.gripper is None:
        lines += _describe_beyond(arm, found.robot)

    given = [f"robot={named.name}", *_write_settings(cfg.robot), *hand, home_word]
    if chosen.flange is None:
        given.append(f"robot.flange={hydra_word(arm.flange)}")

    words = [*given, *found.words]
    lines.append(f"type next: python -m core.run {shlex.join(words)} task=BringCube")
    return Taken(lines, words, _find_frames(words))


def _take_hand(
    description: Description, chosen: ArmSettings, notes: list[str]
) -> tuple[ArmSettings, list[str]]:
    """Take the parallel gripper on the flange as the arm's, unless a setting says what it is.

    Returns:
        the settings, and the words that say so.
    """
    if chosen.gripper or chosen.without or chosen.fixed:
        return chosen, []

    flange = choose_flange(description, chosen.flange, [])
    fingers = find_fingers(description, flange)
    if fingers is None:
        return chosen, []

    bearer = description.named[fingers[0]].parent
    below = description.above(bearer)
    if bearer == flange:
        return chosen, []

    base = below[below.index(flange) - 1]
    notes.append(
        f"{base!r}, whose fingers slide apart, is taken for the arm's gripper; robot.without=[{base}] leaves it out"
    )
    words = [f"robot.gripper={hydra_word({'link': base, 'joints': list(fingers)})}"]
    return replace(chosen, gripper=GripperOptions(base, fingers)), words


def _write_settings(robot: DictConfig) -> list[str]:
    """Write the settings of the arm that were given, but for home."""
    left = {"name", "home"}
    given: Any = OmegaConf.to_container(robot)
    default: Any = OmegaConf.to_container(load("import", ["robot=urdf"]).robot)
    return [
        f"robot.{key}={hydra_word(value)}"
        for key, value in given.items()
        if key not in left and value != default.get(key)
    ]


def _find_frames(words: Sequence[str]) -> dict[str, Pose]:
    """Find where mount, fingers and base are, of the arm that words describe."""
    robot = part(ROBOT, load("evaluate", list(words)).robot).create()
    poses = link_poses(robot, robot.gripper is not None, np.array(robot.home))
    names = (robot.description.root, RIGID_MOUNT, *GRIPPER_MOUNTS)
    return {name: poses[name] for name in names if name in poses}


def take_gripper(file: Path, _cfg: DictConfig) -> Taken:
    """Say how a gripper becomes a part of an arm's file."""
    root = read_root(read_untrusted(file, MAX_BYTES), file)
    description = read_tree(root, file.stem)
    fingers = find_fingers(description)
    if fingers is None:
        raise UserError(
            f"{file} has no two slides that open from 0 in opposite ways; only parallel grippers are used"
        )

    base = description.root
    return Taken(
        [
            f"{file} is a parallel gripper, with the fingers {' and '.join(fingers)}; make it a part of an arm's "
            "URDF: copy its links and joints there, and join it to the flange:",
            f'<joint name="gripper_fixed" type="fixed"><parent link="FLANGE"/><child link="{base}"/></joint>',
            "and then: vlmgineer import ARM.urdf robot.flange=FLANGE "
            + write_word("gripper", {"link": base, "joints": list(fingers)}),
        ]
    )


def _describe_beyond(arm: Unmounted, robot: Robot) -> list[str]:
    """Say what is in the way of tools, and how to take it out or use it as the gripper."""
    description = arm.description
    solid = set[str]()
    for name, link in description.links.items():
        if link.visuals or link.collisions:
            solid |= {*description.above(name)}

    on_flange = [j.child for j in description.joints.values() if j.parent == arm.flange]
    beyond = [link for link in on_flange if link in solid]
    if beyond:
        words = write_word("without", beyond)
        lines = [f"{', '.join(beyond)} hang where tools go; leave out {words}"]
        fingers = find_fingers(description, beyond[0])
        if fingers is not None:
            gripper = {"link": beyond[0], "joints": list(fingers)}
            lines.append(f"or use it as the gripper: {write_word('gripper', gripper)}")

        return lines

    depth = measure_depth(robot)
    if depth > _BEYOND_M:
        return [
            f"tools begin at the frame of {arm.flange!r}, and its shape reaches {1000 * depth:.0f} mm beyond; if tools "
            "go on its face:",
            f"robot.face_m={depth:.4f}",
        ]

    return []

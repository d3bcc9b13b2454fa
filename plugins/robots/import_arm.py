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
from core.support.templates import fill
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

    home = arm_of(found.robot).home
    place = named.pose.apply(found.factor * arm_of(found.robot).forward(home).position)
    place[2] += found.lift_m
    home_word = f"robot.home=[{short_numbers(home, HOME_DIGITS, ',')}]"
    given = [f"robot={named.name}", *_write_settings(cfg.robot), *hand, home_word]
    if chosen.flange is None:
        given.append(f"robot.flange={hydra_word(arm.flange)}")

    words = [*given, *found.words]
    said = fill(
        "plugins.robots",
        "arm",
        arm=arm,
        larger=describe_factor(found.factor) if found.factor != 1 else "",
        place=short_numbers(place, 3, ", "),
        found_words=[home_word, *hand, *found.words],
        command=shlex.join(words),
        word=write_word,
        **_find_beyond(arm, found.robot),
    )
    lines = said.splitlines()
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

    said = fill(
        "plugins.robots",
        "gripper",
        file=file,
        fingers=fingers,
        base=description.root,
        word=write_word,
    )
    return Taken(said.splitlines())


def _find_beyond(arm: Unmounted, robot: Robot) -> dict[str, Any]:
    """Find what is in the way of tools: links, the fingers of the first, and how far the flange's shape reaches."""
    if robot.gripper is not None:
        return {"beyond": [], "depth_m": 0.0}

    description = arm.description
    solid = set[str]()
    for name, link in description.links.items():
        if link.visuals or link.collisions:
            solid |= {*description.above(name)}

    on_flange = [j.child for j in description.joints.values() if j.parent == arm.flange]
    beyond = [link for link in on_flange if link in solid]
    return {
        "beyond": beyond,
        "fingers": find_fingers(description, beyond[0]) if beyond else None,
        "depth_m": measure_depth(robot),
    }

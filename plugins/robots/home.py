"""``vlmgineer home robot=urdf robot.path=FILE ...``: find joints at which the flange of one's own arm looks down."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from omegaconf import MISSING

from core.config.compose import load, part
from core.errors import UsageError, UserError
from core.interfaces import Robot
from core.plugins import ROBOT
from core.plugins.registry import check_settings
from core.robot.kinematics import arm_of
from core.support.cli import arguments, say
from core.support.text import short_numbers
from plugins.robots.arm_files import read_arm
from plugins.robots.arm_settings import ArmSettings
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

USAGE = (
    "usage: vlmgineer home robot=urdf robot.path=FILE [robot.flange=LINK ...] [at=[x,y,z]]; at: where the flange is to "
    "be in the world, metres"
)
_BEYOND_M = 1e-3  # what reaches less beyond the mount is nothing


@dataclass
class HomeConfig:
    """Settings of ``vlmgineer home``; ``at``: None: where most tasks begin."""

    robot: dict[str, Any] = MISSING
    at: list[float] | None = None


def main(words: list[str]) -> None:
    cfg = load("home", arguments(USAGE, words), HomeConfig)
    named = part(ROBOT, cfg.robot)
    if named.name != "urdf":
        raise UsageError(
            f"robot={named.name} has a home; give your own arm: robot=urdf robot.path=FILE"
        )

    at = cfg.at
    if at is not None and not (len(at) == 3 and all(map(math.isfinite, at))):
        raise UsageError(f"at must be three numbers, metres, got {at}")

    chosen = ArmSettings(**check_settings(urdf, dict(named.settings), "robot=urdf", {}))
    factor = find_factor(chosen.reach)
    try:
        arm = build_unmounted(*read_arm(chosen), chosen, anywhere=True)
        say(*arm.notes)
        if at is None and chosen.reach is None and not any(named.base):
            found = find_for_tasks(arm, chosen)
        else:
            place = named.pose.inverse().apply(np.array(at or START))
            found = replace(find_home(arm, chosen, place / factor), factor=factor)
    except UserError as error:  # a line for each problem
        lines = map(str, error.problems or [error])
        raise type(error)("\n- ".join(lines)) from error

    if found.factor != 1:
        say(describe_factor(found.factor))

    home = arm_of(found.robot).home
    place = named.pose.apply(found.factor * arm_of(found.robot).forward(home).position)
    place[2] += found.lift_m
    say(
        f"the flange {arm.flange!r}, borne by {', '.join(arm.joints)}, is at "
        f"({short_numbers(place, 3, ', ')}) and looks down",
        f"robot.home=[{short_numbers(home, HOME_DIGITS, ',')}]",
        *found.words,
    )
    if found.robot.gripper is None:
        _describe_beyond(arm, found.robot)


def _describe_beyond(arm: Unmounted, robot: Robot) -> None:
    """Say what is in the way of tools, and how to take it out."""
    description = arm.description
    solid = set[str]()
    for name, link in description.links.items():
        if link.visuals or link.collisions:
            solid |= {*description.above(name)}

    on_flange = [j.child for j in description.joints.values() if j.parent == arm.flange]
    beyond = [link for link in on_flange if link in solid]
    if beyond:
        words = write_word("without", beyond)
        say(f"{', '.join(beyond)} hang where tools go; leave out {words}")
        return

    depth = measure_depth(robot)
    if depth > _BEYOND_M:
        say(
            f"tools begin at the frame of {arm.flange!r}, and its shape reaches {1000 * depth:.0f} mm beyond; if tools "
            "go on its face:",
            f"robot.face_m={depth:.4f}",
        )

"""``vlmgineer facts [robot=NAME]``: say where an arm reaches, how fast it is, and how exact it was in each engine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from omegaconf import MISSING

from core.config.compose import load, part
from core.interfaces import Robot, RolloutSettings
from core.plugins import ROBOT
from core.robot.kinematics import arm_of
from core.support.cli import arguments, say
from core.support.templates import fill
from plugins.vlms.context.arm_facts import segments
from plugins.vlms.context.reach import compute_reach

USAGE = "usage: vlmgineer facts [robot=NAME]"


@dataclass
class FactsConfig:
    """Settings of ``vlmgineer facts``."""

    robot: dict[str, Any] = MISSING


def sheet(robot: Robot) -> str:
    """Write all facts about the arm as Markdown: reach, speed, and what was measured in each engine."""
    arm = arm_of(robot)
    limits = np.column_stack(
        [arm.home, arm.lower, arm.upper, arm.velocity_limits, arm.acceleration_limits]
    )
    return fill(
        "plugins.vlms.context",
        "facts",
        robot=robot,
        joints=list(zip(robot.arm_joints, limits.tolist(), strict=True)),
        reach=compute_reach(arm),
        speed=segments(arm, arm.forward(arm.home), RolloutSettings()),
        measured=robot.measured,
    )


def main(words: list[str]) -> None:
    config = load("facts", arguments(USAGE, words), FactsConfig)
    robot = part(ROBOT, config.robot).create()
    say(*sheet(robot).splitlines())

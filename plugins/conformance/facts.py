"""``vlmgineer facts [robot=NAME]``: say where an arm reaches, how fast it is, and how exact it was in each engine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from omegaconf import MISSING

from core.config.compose import load, robot_part
from core.designs.arm_sheet import as_table, compute_reach, segments, short
from core.interfaces import Robot, RolloutSettings
from core.robot.kinematics import arm_of
from core.support.cli import arguments, say
from core.support.text import table

USAGE = "usage: vlmgineer facts [robot=NAME]"
Figures = Mapping[str, Mapping[str, float | None]]

LABELS = {
    "lag_rad": "largest lag of a joint in motion, rad",
    "lag_mm": "largest lag of the end-effector in motion, mm",
    "rest_mm": "miss at rest after the motion, mm",
    "lag_rad_0.3kg": "lag of a joint, tool of 0.3 kg, rad",
    "lag_mm_0.3kg": "lag of the end-effector, tool of 0.3 kg, mm",
    "rest_mm_0.3kg": "miss at rest, tool of 0.3 kg, mm",
    "lag_rad_1kg": "lag of a joint, tool of 1 kg, rad",
    "lag_mm_1kg": "lag of the end-effector, tool of 1 kg, mm",
    "rest_mm_1kg": "miss at rest, tool of 1 kg, mm",
    "sag_mm_1kg": "sag under a load of 1 kg that it carries, mm",
    "push_n_per_mm": "force for each millimetre that it is held back, N",
    "turn_nm_per_rad": "torque for each radian that it is turned back about x, N m",
    "most_n": "largest load that it holds, N",
    "pressed_depth_mm": "2 mm into the table: depth of the tip, mm",
    "pressed_lag_rad": "2 mm into the table: lag of a joint, rad",
    "pressed_slip_mm": "2 mm into the table: largest slip of the tip, mm",
    "pressed_bounce_mm": "2 mm into the table: largest height of the tip after contact, mm",
    "slid_miss_mm": "then 0.1 m along the table: miss at rest, mm",
    "pressed_cube_mm": "2 mm into a cube of 0.1 kg on the table: its largest shift, mm",
}


@dataclass
class FactsConfig:
    """Settings of ``vlmgineer facts``."""

    robot: dict[str, Any] = MISSING


def sheet(robot: Robot, figures: Figures) -> str:
    """Write all facts about the arm as Markdown: reach, speed, and the figures of each engine."""
    arm = arm_of(robot)
    reach, timed = compute_reach(arm), segments(arm, arm.forward(arm.home), RolloutSettings())
    limits = arm.lower, arm.upper, arm.velocity_limits, arm.acceleration_limits
    joints = zip(robot.arm_joints, arm.home, *limits, strict=True)
    parts = {
        "Reach": [
            "Smallest and largest horizontal distance of the end-effector from the base's axis in centimetres, "
            "straight ahead of the base at its yaw and roll = 0, by height z in metres and pitch in radians:",
            as_table(reach),
        ],
        "Joints": [
            table(
                ["joint", "home rad", "lowest rad", "highest rad", "speed rad/s", "acceleration rad/s²"],
                [[name, *(f"{number + 0.0:.4g}" for number in numbers)] for name, *numbers in joints],
            )
        ],
        "Speed": [
            table(
                ["straight through home", "length m", "time s", "peak speed / mean speed"],
                [[one.way, f"{one.length:g}", f"{one.seconds:.2f}", f"{one.peak:.2f}"] for one in timed],
            )
        ],
    }
    if figures:
        parts["Exactness"] = [
            table(
                ["figure", *figures],
                [[text, *(_number(one.get(name)) for one in figures.values())] for name, text in LABELS.items()],
            )
        ]
    carries = f"payload {robot.payload_kg:g} kg, {'with' if robot.gripper else 'without'} a gripper"
    lines = [f"{robot.title}: {len(robot.arm_joints)} joints, {carries}.\n\n"]
    for title, texts in parts.items():
        lines += [f"## {title}\n\n", *(f"{text}\n\n" for text in texts)]
    return "".join(lines)


def _number(figure: float | None) -> str:
    return "full force at once" if figure is None else short(figure)


def main(words: list[str]) -> None:
    robot = robot_part(load("facts", arguments(USAGE, words), FactsConfig).robot).create()
    say(*sheet(robot, robot.measured).splitlines())

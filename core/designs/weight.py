"""Check that an arm can carry a tool of a real material, and say in a prompt what tools weigh."""

from __future__ import annotations

import math

import numpy as np

from core.design import DesignError, Tool
from core.geometry import mass_properties
from core.interfaces import Robot
from core.robot.frames import open_mounts
from core.robot.kinematics import arm_of
from core.values.materials import PAPER, Material

GRAVITY = 9.81  # m/s^2


def moment_limit(robot: Robot) -> float:
    """Return the largest moment about the mount that the wrist bears in any posture, N m.

    It is the smallest effort limit of the last three joints, of which one is level in some posture.
    """
    return float(arm_of(robot).effort_limits[-3:].min())


def flange_moment(tool: Tool, robot: Robot) -> float:
    """Compute the largest moment of a tool's weight about the mount, N m: with its centre of mass level with it."""
    mounts, placed = open_mounts(robot, tool.gripper), tool.placed()
    weights = np.zeros(3)
    for c in tool.components:
        mount, pose = placed[c.name]
        weights += c.mass * (mounts[mount] @ pose).apply(mass_properties(c.shape, c.mass)[0])
    return GRAVITY * float(np.linalg.norm(weights))


def mass_limit(robot: Robot, material: Material) -> tuple[float, str]:
    """Return how much a tool may weigh, kg, and the reason in words."""
    most_kg = math.inf if material.most_g is None else material.most_g / 1000
    if most_kg < robot.payload_kg:
        return most_kg, f"the budget of material is {most_kg:g} kg"
    return robot.payload_kg, f"the arm carries at most {robot.payload_kg:g} kg"


def check_weight(tool: Tool, robot: Robot, material: Material = PAPER) -> None:
    """Refuse a tool that is too heavy for an arm or its material's budget, or too far out for its weight.

    Raises:
        DesignError: with the figures, and the component that weighs most.
    """
    heaviest = max(tool.components, key=lambda component: component.mass)
    mend = f"component {heaviest.name!r} weighs most, {heaviest.mass:.3g} kg: make parts thinner, shorter or fewer"
    most_kg, why = mass_limit(robot, material)
    if tool.mass > most_kg:
        raise DesignError(f"the tool weighs {tool.mass:.3g} kg; {why}; {mend}")
    moment, most = flange_moment(tool, robot), moment_limit(robot)
    if moment > most:
        raise DesignError(
            f"the tool, of {tool.mass:.3g} kg, turns the wrist with {moment:.3g} N m, its centre of mass being "
            f"{moment / GRAVITY / tool.mass:.3g} m from the mount; at most {most:g} N m are allowed; {mend}, or bring "
            "heavy parts closer to the mount"
        )


def describe_weight(material: Material, robot: Robot) -> str:
    """Write the part of a prompt that says what tools of a real material weigh, and what they may; a list item."""
    payload, moment = f"{mass_limit(robot, material)[0]:g} kg", f"{moment_limit(robot):g} N m"
    return f"""\
- Tools are made of {material.name}, {material.density_kg_m3:g} kg/m^3, {material.filling}. What a component
  weighs follows from its volume; a mass that you write is ignored. The tool may weigh {payload}, and turn the wrist
  with {moment}: its mass in kg times {GRAVITY:g} times the distance in metres of its centre of mass from the mount."""

"""Check that an arm can carry a tool."""

from __future__ import annotations

import math

import numpy as np

from core.design import DesignError, Tool
from core.interfaces import Robot
from core.robot.kinematics import arm_of, open_mounts
from core.values.materials import Material
from core.values.refusals import DesignReason

GRAVITY = 9.81  # m/s^2


def moment_limit(robot: Robot) -> float:
    """Return the largest moment about the mount that the wrist bears in any posture, N m.

    It is the smallest effort limit of the last three joints, of which one is level in some posture.
    """
    return float(arm_of(robot).effort_limits[-3:].min())


def flange_moment(tool: Tool, robot: Robot) -> float:
    """Compute the largest moment of a tool's weight about the mount, N m: with its centre of mass level with it."""
    mounts = open_mounts(robot, tool.gripper)
    placed = tool.placed()

    moments = np.zeros(3)  # of mass
    for component in tool.components:
        mount, pose = placed[component.name]
        center, _ = component.shape.inertia(component.mass)
        moments += component.mass * (mounts[mount] @ pose).apply(center)

    return GRAVITY * float(np.linalg.norm(moments))


def mass_limit(robot: Robot, material: Material) -> tuple[float, str]:
    """Return how much a tool may weigh.

    Args:
        robot: what carries it.
        material: may have a budget.

    Returns:
        The mass, kg, and the reason in words.
    """
    budget_kg = math.inf if material.most_g is None else material.most_g / 1000
    if budget_kg < robot.payload_kg:
        return budget_kg, f"the budget of material is {budget_kg:g} kg"

    return robot.payload_kg, f"the arm carries at most {robot.payload_kg:g} kg"


def check_weight(tool: Tool, robot: Robot, material: Material) -> None:
    """Refuse a tool that is too heavy for an arm or its material's budget, or of a real one too far out for its weight.

    Args:
        tool: with the masses that it has.
        robot: what carries it.
        material: what it is made of.

    Raises:
        DesignError: with the figures, and the component that weighs most.
    """
    heaviest = max(tool.components, key=lambda component: component.mass)
    weighs = {
        "mass_kg": tool.mass,
        "heaviest": heaviest.name,
        "heaviest_kg": heaviest.mass,
    }
    most_kg, why = mass_limit(robot, material)

    if tool.mass > most_kg:
        raise DesignError.because(
            DesignReason.TOO_HEAVY, most_kg=most_kg, limit=why, **weighs
        )
    if material.density_kg_m3 is None:
        return

    moment = flange_moment(tool, robot)
    most = moment_limit(robot)
    if moment > most:
        raise DesignError.because(
            DesignReason.MOMENT,
            moment_n_m=moment,
            most_n_m=most,
            away_m=moment / GRAVITY / tool.mass,
            **weighs,
        )

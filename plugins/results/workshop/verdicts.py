"""Judge whether a tool can be made and borne: what fails, by which figures, and what to change."""

from __future__ import annotations

import math
from collections.abc import Sequence

from core.design import Tool
from core.designs.statics import flange_moment, mass_limit, moment_limit
from core.goals import reaches
from core.interfaces import Task
from core.support.templates import macros
from core.values.materials import Material
from core.values.robots import Robot
from plugins.results.workshop.life_size import to_life
from plugins.results.workshop.printing import Check
from plugins.results.workshop.strength import Strength
from plugins.results.workshop.tool import PrintedTool

SAFETY = 2.0  # the strength over the stress, at least
SOFT_M = 0.01  # what bends by more is noted: engines took it to be rigid
BENT = 0.5  # of the least tolerance of the task's goals: what bends by more fails
TOLERANCE_M = 0.04  # of a goal that names none


def list_verdicts(
    printed_tool: PrintedTool, strengths: Sequence[Strength], task: Task
) -> list[Check]:
    """List what was checked of a tool with its motion: that an arm carries it, that it can be made, what it bears.

    Args:
        printed_tool: the tool as parts, with the checks of its motion.
        strengths: the worst of each component.
        task: what it was made for.
    """
    material = printed_tool.material
    return [
        *carried(printed_tool.printed, task.robot.life_size, material),
        *printed_tool.verdicts,
        *strong(material, strengths, task),
    ]


def carried(tool: Tool, robot: Robot, material: Material) -> list[Check]:
    """Judge whether an arm carries a tool: its mass, and its moment about the flange."""
    heaviest = max(tool.components, key=lambda component: component.mass)
    mend = macros("plugins.results.workshop", "words").heaviest(heaviest)
    most, why = mass_limit(robot, material)
    weighs = f"{tool.mass:.3f} kg; {why}"
    moment = flange_moment(tool, robot)
    bears = moment_limit(robot)
    turns = f"{moment:.2f} N m at the flange; the wrist bears {bears:g} N m"

    return [
        Check("mass", tool.mass <= most, weighs, mend),
        Check("moment", moment <= bears, turns, mend),
    ]


def strong(
    material: Material,
    strengths: Sequence[Strength],
    task: Task,
    safety: float = SAFETY,
) -> list[Check]:
    """Judge strength and stiffness of components; where all bear what they must, the weakest is named.

    Args:
        material: of the tool; one without a strength is not judged.
        strengths: the worst of each component.
        task: whose goals say by how much a tool may bend.
        safety: the least strength over stress.
    """
    if material.strength_pa is None:
        choose = f"material={material.name} has no strength: choose one, such as material=pla"
        return [Check("strength", None, choose)]

    factors = [(row, row.safety) for row in strengths if row.safety is not None]
    factors.sort(key=lambda pair: pair[1])
    weak = [pair for pair in factors if pair[1] < safety]
    checks = [
        _judge_strength(row, factor, safety) for row, factor in weak or factors[:1]
    ]
    softest = max(strengths, key=lambda row: row.bend_m, default=None)
    allowed_m = BENT * tolerance(task)
    if softest is not None and softest.bend_m > min(SOFT_M, allowed_m):
        checks.append(_judge_stiffness(softest, allowed_m))

    return checks


def _judge_strength(row: Strength, factor: float, safety: float) -> Check:
    thicker = math.ceil(10 * math.sqrt(safety / factor)) / 10
    words = macros("plugins.results.workshop", "words")
    bears = words.bears(row, factor, safety)
    mend = words.thicken(row, thicker)
    return Check("strength", factor >= safety, bears, mend, row.component)


def _judge_stiffness(row: Strength, allowed_m: float) -> Check:
    """Fail what bends by more than is allowed, and note the rest."""
    found = macros("plugins.results.workshop", "words").bends(row, allowed_m)
    passed = False if row.bend_m > allowed_m else None
    mend = "thicken or shorten it, choose a stiffer material, or move more slowly where it pushes"
    return Check("rigid", passed, found, mend)


def tolerance(task: Task) -> float:
    """Return the least tolerance of a task's goals that is a length, in the size of the arm itself, metres."""
    scene = task.scene(0)
    lengths = []
    for goal in reaches(task.goals):
        lengths += [part.tolerance_m(scene) for part in goal.parts]

    least = min((length for length in lengths if length > 0), default=TOLERANCE_M)
    return to_life(task.robot).length * least

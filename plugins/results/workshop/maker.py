"""Say whether the tool of a design can be made and bears what it has to, in how many pieces and hours, or why not."""

from __future__ import annotations

import math
from dataclasses import replace

from core.config.compose import load, node, task_parts
from core.design import DesignError, Tool
from core.designs.stiffness import find_weakness
from core.errors import UserError
from core.events import Run
from core.interfaces import Condition, Material, Printer, Robot
from core.support.templates import macros
from core.trial import Evaluation, Making
from core.values.materials import PAPER
from plugins.results.chosen import config_for_run
from plugins.results.workshop.examination import (
    PROBLEM,
    Examination,
    find_problem,
    print_tool,
)
from plugins.results.workshop.export_command import ExportConfig
from plugins.results.workshop.life_size import to_life
from plugins.results.workshop.playback import make_export
from plugins.results.workshop.printing import PLA_G_PER_CM3, Check
from plugins.results.workshop.tool import PrintedTool
from plugins.results.workshop.verdicts import list_verdicts

DEFAULT = "pla"
"""What a tool is taken to be printed in if its run weighs tools as the paper does."""

ANY_MARGIN_M = -math.inf
"""How near the arm may come to itself and to what is fixed: an export says it, and fails for nothing."""

PRINT_MM3_S = 5.0
"""What a printer lays down: sixteen tools took 4.4 to 5.4 by PrusaSlicer, with changes of layers and supports."""


def judge_design(run: Run, condition: Condition, tried: Evaluation) -> Making | None:
    """Say whether the tool of a design can be made; None: it has no parts.

    It can where ``vlmgineer export`` finds nothing that fails: its motion is played once more in each engine, with
    forces. Where it fails in the run's engine alone, no other is asked. Of a run with the material ``paper`` it is PLA
    that is looked at, and only whether that is stiff.

    Args:
        run: whose material and printer count.
        condition: where the design was tried.
        tried: the design, with what came of it.
    """
    tool = tried.candidate.tool
    representation = run.representation
    if tool is None:
        return None

    making = judge_tool(
        tool, run.task.robot, representation.material, representation.printer
    )
    if making is None or not making.possible or tried.shown is None:
        return making

    material = representation.material
    if material.density_kg_m3 is None:
        return making

    examination = Examination(material, representation.printer, margin_m=ANY_MARGIN_M)
    try:
        seen = examination.examine(condition, tried.candidate, tried.shown)
        for objection in seen.objections:
            return _refuse(material, objection.removeprefix(PROBLEM))

        failing = _find_failing(run, tried, tool)
    except UserError as error:  # an engine says nothing of forces, or can't play it
        return replace(
            making, words=f"{making.words}; its strength is not known: {error}"
        )

    if failing is None:
        return making
    return Making(False, f"{making.words}; exported it fails ({failing})", str(failing))


def _find_failing(run: Run, tried: Evaluation, tool: Tool) -> Check | None:
    """Find the first check that an export of a design fails; None: none does."""
    cfg = config_for_run(run.config, "export", ExportConfig)
    representation = run.representation
    robot = run.task.robot
    printed = print_tool(
        to_life(robot).tool(tool),
        robot.life_size,
        representation.material,
        representation.printer,
    )
    for part in task_parts(cfg):
        export = make_export(cfg, part, tried, printed)
        checked = printed.with_checks(*export.checks)
        for verdict in list_verdicts(checked, export.strengths, export.task):
            if verdict.passed is False:
                return verdict

    return None


def judge_tool(
    tool: Tool, robot: Robot, material: Material, printer: Printer
) -> Making | None:
    """Say of a tool what `judge_design` says, but what its motion does to it."""
    if not tool.components:
        return None

    if material.name == PAPER.name:
        material = node(load("evaluate", [f"material={DEFAULT}"]).material, Material)

    larger = robot.enlarged
    tool = to_life(robot).tool(tool)
    robot = robot.life_size
    problem = find_problem(tool, robot, material, printer)
    if problem is not None:
        return _refuse(material, str(problem))
    try:
        weakness = find_weakness(tool, robot, material, larger)
    except DesignError as error:
        return _refuse(material, str(error))
    if weakness is not None:
        return _refuse(material, str(weakness))

    return Making(True, _describe(print_tool(tool, robot, material, printer)))


def _refuse(material: Material, why: str) -> Making:
    how = "to be milled" if material.is_metal else "printable"
    return Making(False, f"{how}: no ({why})", why)


def _describe(printed: PrintedTool) -> str:
    """Say in how many pieces a tool comes, how long printing takes, and how much it weighs."""
    grams_h = PRINT_MM3_S * 3.6 * PLA_G_PER_CM3
    hours = math.ceil(printed.mass_g / grams_h)
    return str(macros("plugins.results.workshop", "words").made(printed, hours))

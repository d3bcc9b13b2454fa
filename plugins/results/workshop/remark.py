"""Say in a few words whether the best tool of a run can be made."""

from __future__ import annotations

from core.config.compose import load, node
from core.design import Candidate
from core.events import Run
from core.interfaces import Material
from core.values.materials import PAPER
from plugins.results.workshop.examination import PROBLEM, find_problem
from plugins.results.workshop.settings import Printer

DEFAULT = "pla"
"""What a tool is taken to be printed in if its run weighs tools as the paper does."""


def say_printable(run: Run, best: Candidate) -> str | None:
    """Say whether a printer makes a tool and the arm carries it, and if not, which check fails; None: it has no parts.

    Of a run with the material ``paper`` it is PLA that is looked at.
    """
    tool = best.tool
    if tool is None or not tool.components:
        return None

    material = run.representation.material
    if material.name == PAPER.name:
        material = node(load("evaluate", [f"material={DEFAULT}"]).material, Material)

    printer = Printer()
    plate_mm = tuple(printer.plate_mm)
    robot = run.task.robot
    problem = find_problem(tool, robot, material, plate_mm, printer.min_wall_mm)
    verdict = "yes"
    if problem is not None:
        verdict = f"no ({problem.removeprefix(PROBLEM)})"

    return f"printable in {material.name}: {verdict}"

"""Say in a few words whether the best tool of a run can be made, and whether it bears what it has to."""

from __future__ import annotations

from core.config.compose import load, node
from core.design import Candidate, DesignError, Tool
from core.designs.stiffness import find_weakness
from core.events import Run
from core.interfaces import Material, Robot
from core.support.text import count_words
from core.values.materials import PAPER
from core.values.printers import Printer
from plugins.results.workshop.examination import find_problem, print_tool
from plugins.results.workshop.life_size import to_life

DEFAULT = "pla"
"""What a tool is taken to be printed in if its run weighs tools as the paper does."""


def say_printable(run: Run, best: Candidate) -> str | None:
    """Say whether a printer makes a tool, the arm carries it, and it is stiff; None: it has no parts.

    Where it is not, the line says which check fails, and how to search for what can be made.
    Of a run with the material ``paper`` it is PLA that is looked at.
    """
    if best.tool is None:
        return None
    return describe_printing(best.tool, run.task.robot, run.representation.material)


def describe_printing(tool: Tool, robot: Robot, material: Material) -> str | None:
    """Say of a tool what `say_printable` says of the best one; ``material`` is that of its run."""
    if not tool.components:
        return None

    if material.name == PAPER.name:
        material = node(load("evaluate", [f"material={DEFAULT}"]).material, Material)

    larger = robot.enlarged
    tool = to_life(robot).tool(tool)
    robot = robot.life_size
    problem = find_problem(tool, robot, material, Printer())
    if problem is None:
        printed = print_tool(tool, robot, material, Printer())
        pieces = count_words(len(printed.parts), "piece")
        verdict = f"yes, in {pieces}, {printed.mass_g:.0f} g"
    else:
        verdict = f"no (this check fails: {problem})"

    soft = _find_softness(tool, robot, material, larger)
    if soft:
        verdict += f", but {soft}"
    if soft or problem is not None:
        verdict += f"; search with fitness=buildable material={material.name}"

    return f"printable in {material.name}: {verdict}"


def _find_softness(tool: Tool, robot: Robot, material: Material, larger: float) -> str:
    """Say which component bends too far or breaks at a load at its end, see `find_weakness`; empty: none does."""
    try:
        weakness = find_weakness(tool, robot, material, larger)
    except DesignError as error:
        return str(error)

    return "" if weakness is None else weakness.found

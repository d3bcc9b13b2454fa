"""Read the anchored reference solutions of all benchmarks."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

from core.config.compose import load, tool_part
from core.design import Candidate
from core.designs.planning import resolve
from core.designs.reading import load_designs, read_designs
from core.interfaces import RolloutSettings, ToolRepresentation
from core.plugins import installed

TASKS = Path(__file__).parents[1] / "tasks"
PLACES = ("anchored", "hardtoolbench", "softtoolbench")
FILES = {
    file.stem: file for place in PLACES for file in (TASKS / place).glob("[A-Z]*.json")
}


def anchored(name: str, material: str = "paper") -> Candidate:
    """Read the anchored solution of a task."""
    file, task = FILES[name], installed().create("task", name)
    return read_designs(load_designs(file), representation(file, material), task)[0]


def literal(name: str) -> Candidate:
    """Read the same tool with the plan's waypoints of the nominal layout."""
    solution, task = anchored(name), installed().create("task", name)
    return replace(solution, plan=resolve(solution.plan, task, 0, RolloutSettings()))


def representation(file: Path, material: str = "paper") -> ToolRepresentation:
    """Return the representation that a designs file was written for, by its fields; with joints, if it has any."""
    written = load_designs(file)["strategies"][0]
    items = [
        item
        for key in ("tool_components", "tool_solids")
        for item in written.get(key, ())
    ]
    joints = any("joint" in item for item in items)
    return next(
        tool
        for tool in _representations(material, joints)
        if {*tool.schema()} <= {*written}
    )


@cache
def _representations(material: str, joints: bool) -> list[ToolRepresentation]:
    names = ("urdf", "boxes", "solids")
    words = [
        [f"tool={name}", f"material={material}", f"tool.joints={joints}"]
        for name in names
    ]
    return [tool_part(load("evaluate", of)).create() for of in words]

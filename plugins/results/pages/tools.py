"""The tools in a run's store, best first, as solids that can be drawn and printed."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from omegaconf import OmegaConf

from core.config.compose import task_part, tool_part
from core.design import Tool, ranked
from core.designs.reading import read_designs
from core.designs.rules import SpawnRules
from core.errors import UserError
from core.geometry import Array
from core.interfaces import Material, Robot, ToolRepresentation
from core.robot.meshes import as_held
from core.store.reader import Key, StoredEvaluation
from plugins.results.pages.runs import FinishedRun

SAME = 1e-4  # metres by which corners of equal tools may differ
_FARTHEST, _THINNEST = 100.0, 1e-6  # metres


@dataclass(frozen=True, eq=False)
class Winner:
    """A tool with the reward of its best action plan. Texts are the model's, on one line, without control characters.

    ``name`` is the tool's, else the strategy's, else the candidate's; ``use``, how the strategy uses it; ``design``,
    tool and plan as a strategy of a designs file.
    """

    run: FinishedRun
    robot: Robot
    material: Material
    tool: Tool
    name: str
    use: str
    candidate: str
    reward: float
    distance_m: float | None
    design: dict[str, Any]


@lru_cache(maxsize=256)
def _parts(settings: str, seed: int) -> tuple[ToolRepresentation, SpawnRules]:
    config = OmegaConf.create(json.loads(settings))
    return tool_part(config).create(), SpawnRules(task_part(config).create(), seed)


def winners(run: FinishedRun, count: int | None = None, apart: float = SAME) -> list[Winner]:
    """The tools with the highest rewards, each of another shape (`distinct`), the best first.

    Raises:
        UserError: a part of the run is not installed here, or its store is missing or damaged.
    """
    return distinct(every_tool(run), count, apart)


def distinct(tools: Iterable[Winner], count: int | None, apart: float) -> list[Winner]:
    """The first ``count`` tools, each of another shape. Two shapes are the same where they have equally many
    components, and all corners are less than ``apart`` metres from the other's.
    """
    chosen: list[Winner] = []
    shapes: list[list[Array]] = []  # corners (V, 3) of each component, as the arm holds it
    for winner in tools:
        shape = [np.asarray(solid.vertices) for _, solid in as_held(winner.tool, winner.robot)]
        if not any(_alike(shape, known, apart) for known in shapes):
            shapes.append(shape)
            chosen.append(winner)
        if len(chosen) == count:
            break
    return chosen


def _alike(a: list[Array], b: list[Array], apart: float) -> bool:
    return [p.shape for p in a] == [q.shape for q in b] and all(
        float(np.linalg.norm(p - q, axis=1).max()) < apart for p, q in zip(a, b, strict=True)
    )


def every_tool(run: FinishedRun) -> Iterator[Winner]:
    """Yield each tool with its best plan, the best first.

    Raises:
        UserError: as `winners`.
    """
    chosen = {name: run.config.get(name, {}) for name in ("task", "tool", "material", "robot")}
    representation, rules = _parts(json.dumps(chosen, sort_keys=True), run.seed)
    tried = [e for e in run.store.evaluations() if e.status == "ok"]
    best: dict[Key, StoredEvaluation] = {}
    order = ranked(tried, lambda e: (e.reward, e.distance_m), run.figures.tie)
    for evaluation in sorted(order, key=lambda e: e.candidate != run.best.candidate):  # what the run chose is first
        best.setdefault(evaluation.design, evaluation)
    designs, robot = run.store.designs(), representation.robot
    for key, evaluation in best.items():
        design = designs[key].written | {"action_sets": [evaluation.plan]}
        # It may break a rule, but must have a size: there were others when it was tried.
        (read,) = read_designs({"strategies": [design]}, representation, rules)
        tool, problem = read.tool, f"the design of {evaluation.candidate} can't be read again: "
        if tool is None:
            raise UserError(f"{problem}{read.problem}")
        for component, solid in as_held(tool, robot):
            sides, corners = component.shape.bounds[1], np.asarray(solid.vertices)
            if not (np.isfinite(corners).all() and np.abs(corners).max() < _FARTHEST and sides.min() > _THINNEST):
                raise UserError(f"{problem}component {component.name!r} has no size that can be drawn")
        name = tool.name or read.strategy_name or evaluation.candidate
        use = read.strategy_description or read.strategy_name
        earned = evaluation.candidate, evaluation.reward, evaluation.distance_m
        yield Winner(run, robot, representation.material, tool, name, use, *earned, design)


def size(tool: Tool, robot: Robot) -> str:
    """The extent along x, y and z, in millimetres."""
    if not tool.components:
        return "no tool"
    extent = np.ptp(np.concatenate([solid.vertices for _, solid in as_held(tool, robot)]), axis=0)
    return " × ".join(f"{1000 * side:.0f}" for side in extent) + " mm"

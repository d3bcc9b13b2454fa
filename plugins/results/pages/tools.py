"""The tools in a run's store, best first, as solids that can be drawn and printed."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from omegaconf import OmegaConf

from core.config.compose import task_part, tool_part
from core.design import DesignError, Tool, ranked
from core.designs.reading import MAX_DESCRIPTION, MAX_NAME
from core.errors import UserError
from core.geometry import Array
from core.interfaces import Material, Robot, Task, ToolRepresentation
from core.robot.meshes import as_held
from core.store.reader import Key, StoredDesign, StoredEvaluation
from core.support.text import clean, number
from plugins.results.pages.runs import FinishedRun

SAME = 1e-4  # metres by which corners of equal tools may differ
_FARTHEST, _THINNEST = 100.0, 1e-6  # metres


@dataclass(frozen=True, eq=False)
class Winner:
    """A tool with the reward of its best action plan. Texts are the model's, on one line, without control characters;
    ``design`` is tool and plan as a strategy of a designs file.
    """

    run: FinishedRun
    robot: Robot
    tool: Tool
    candidate: str
    generation: int
    reward: float
    distance_m: float | None
    design: dict[str, Any]
    material: Material
    strategy_name: str = ""
    strategy_description: str = ""

    @property
    def name(self) -> str:
        """The tool's name, else the strategy's, else the candidate's; never empty."""
        return self.tool.name or self.strategy_name or self.candidate

    @property
    def summary(self) -> str:
        """Reward and size in a line."""
        return f"reward {number(self.reward, 3)}, {size(self.tool, self.robot)}"


def _parts(run: FinishedRun) -> tuple[Task, ToolRepresentation]:
    chosen = {name: run.config.get(name, {}) for name in ("task", "tool", "material", "robot")}
    return _created(json.dumps(chosen, sort_keys=True))


@lru_cache(maxsize=256)
def _created(settings: str) -> tuple[Task, ToolRepresentation]:
    config = OmegaConf.create(json.loads(settings))
    return task_part(config).create(), tool_part(config).create()


def given_tool(run: FinishedRun) -> Tool | None:
    """The tool that the run was given, which may be the bare hand; None where the run designed its tools.

    Raises:
        UserError: the run's task or tool representation is not installed here.
    """
    task, representation = _parts(run)
    given = representation.given(task)
    return given and representation.material.made(given)


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
    given, (_, representation) = given_tool(run), _parts(run)
    tried = [e for e in run.store.evaluations() if e.status == "ok"]
    best: dict[Key, StoredEvaluation] = {}
    order = ranked(tried, lambda e: (e.reward, e.distance_m), run.figures.tie)
    for evaluation in sorted(order, key=lambda e: e.candidate != run.best.candidate):  # what the run chose is first
        best.setdefault(evaluation.design, evaluation)
    designs = run.store.designs()
    for key, evaluation in best.items():
        yield _winner(run, evaluation, designs[key], given, representation)


def _winner(
    run: FinishedRun,
    evaluation: StoredEvaluation,
    stored: StoredDesign,
    given: Tool | None,
    representation: ToolRepresentation,
) -> Winner:
    design, robot = stored.written, representation.robot
    try:
        tool = given or representation.parse(design, gripper=bool(design["gripper"]))
        if given is None:
            _check_size(tool, robot)
            tool = representation.material.made(tool)
    except DesignError as error:
        raise UserError(f"the design of {evaluation.candidate} can't be read again: {error}") from error
    if given is None:
        name, description = _text(design, "tool_name", MAX_NAME), _text(design, "tool_description", MAX_DESCRIPTION)
        tool = replace(tool, name=name, description=description)
    return Winner(
        run,
        robot,
        tool,
        evaluation.candidate,
        evaluation.design[0],
        evaluation.reward,
        evaluation.distance_m,
        design | {"action_sets": [evaluation.plan]},
        representation.material,
        _text(design, "strategy_name", MAX_NAME),
        _text(design, "strategy_description", MAX_DESCRIPTION),
    )


def _check_size(tool: Tool, robot: Robot) -> None:
    """Refuse what can't be drawn. It may break a rule: there were others when it was tried."""
    for component, solid in as_held(tool, robot):
        sides, corners = component.shape.bounds[1], np.asarray(solid.vertices)
        if not (np.isfinite(corners).all() and np.abs(corners).max() < _FARTHEST and sides.min() > _THINNEST):
            raise DesignError(f"component {component.name!r} has no size that can be drawn")


def _text(design: dict[str, Any], name: str, longest: int) -> str:
    return clean(str(design.get(name) or ""), longest)


def size(tool: Tool, robot: Robot) -> str:
    """The extent along x, y and z, in millimetres."""
    if not tool.components:
        return "no tool"
    extent = np.ptp(np.concatenate([solid.vertices for _, solid in as_held(tool, robot)]), axis=0)
    return " × ".join(f"{1000 * side:.0f}" for side in extent) + " mm"

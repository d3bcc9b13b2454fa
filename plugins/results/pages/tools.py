"""The best tool in a run's store, as solids that can be drawn and printed."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from omegaconf import OmegaConf

from core.config.compose import task_part, tool_part
from core.design import Tool
from core.designs.reading import read_designs
from core.errors import UserError
from core.interfaces import Material, Robot, Task, ToolRepresentation
from plugins.results.pages.drawing import as_held
from plugins.results.pages.runs import FinishedRun

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
def _parts(settings: str) -> tuple[ToolRepresentation, Task]:
    config = OmegaConf.create(json.loads(settings))
    return tool_part(config).create(), task_part(config).create()


def best_tool(run: FinishedRun) -> Winner:
    """Read the tool of a run's best candidate again.

    Raises:
        UserError: a part of the run is not installed here, or its store is missing or damaged.
    """
    name = run.best.candidate
    evaluation = next(
        (
            e
            for e in run.store.evaluations()
            if e.candidate == name and e.status == "ok"
        ),
        None,
    )
    if evaluation is None:
        raise UserError(f"its best candidate {name} is not among those that were tried")
    chosen = {
        kind: run.config.get(kind, {}) for kind in ("task", "tool", "material", "robot")
    }
    representation, task = _parts(json.dumps(chosen, sort_keys=True))
    design = run.store.designs()[evaluation.design].written | {
        "action_sets": [evaluation.plan]
    }
    # It may break a rule, but must have a size: there were others when it was tried.
    (read,) = read_designs({"strategies": [design]}, representation, task)
    if read.tool is None:
        raise UserError(f"the design of {name} can't be read again: {read.problem}")
    for component, solid in as_held(read.tool, representation.robot):
        corners = np.abs(solid.vertices)
        if not (
            np.isfinite(corners).all()
            and corners.max() < _FARTHEST
            and min(component.shape.bounds[1]) > _THINNEST
        ):
            raise UserError(
                f"component {component.name!r} of {name} has no size that can be drawn"
            )
    return Winner(
        run=run,
        robot=representation.robot,
        material=representation.material,
        tool=read.tool,
        name=read.tool.name or read.strategy_name or name,
        use=read.strategy_description or read.strategy_name,
        candidate=name,
        reward=evaluation.reward,
        distance_m=evaluation.distance_m,
        design=design,
    )


def size(tool: Tool, robot: Robot) -> str:
    """The extent along x, y and z, in millimetres."""
    if not tool.components:
        return "no tool"
    extent = np.ptp(
        np.concatenate([solid.vertices for _, solid in as_held(tool, robot)]), axis=0
    )
    return " × ".join(f"{1000 * side:.0f}" for side in extent) + " mm"

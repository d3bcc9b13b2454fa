"""The best tool in a run's store, as solids that can be drawn and printed."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from omegaconf import OmegaConf

from core.config.compose import task_part, tool_part
from core.config.gate import take_stored
from core.design import Tool
from core.errors import UserError
from core.interfaces import Material, Robot, Task, ToolRepresentation
from core.search.saved_designs import read_stored
from plugins.results.pages.drawing import as_held
from plugins.results.pages.runs import FinishedRun

_FARTHEST = 100.0  # metres
_THINNEST = 1e-6


@dataclass(frozen=True, eq=False)
class Winner:
    """The best tool of a run.

    Texts are the model's, on one line, without control characters.

    Attributes:
        run: where it was found.
        robot: the run's.
        material: of the tool.
        tool: as it can be drawn.
        name: the tool's, else the design's, else the candidate's.
        use: how the design uses it.
    """

    run: FinishedRun
    robot: Robot
    material: Material
    tool: Tool
    name: str
    use: str


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

    for evaluation in run.store.evaluations():
        if evaluation.candidate == name and evaluation.status == "ok":
            break
    else:
        raise UserError(f"its best candidate {name} is not among those that were tried")

    kinds = ("task", "tool", "material", "robot")
    config, _ = take_stored(run.config, run.folder, kinds=kinds)
    settings = {kind: config.get(kind, {}) for kind in kinds}
    representation, task = _parts(json.dumps(settings, sort_keys=True))
    design = run.store.designs()[evaluation.design_key]
    # It may break a rule, but must have a size: there were others when it was tried.
    (read,) = read_stored(design, [evaluation], representation, task)
    if read.tool is None:
        raise UserError(f"the design of {name} can't be read again: {read.problem}")
    for component, solid in as_held(read.tool, representation.robot):
        # Not greater: what is not a number has no size either.
        farthest = np.abs(solid.vertices).max()
        drawable = farthest < _FARTHEST and min(component.shape.bounds[1]) > _THINNEST
        if not drawable:
            raise UserError(
                f"component {component.name!r} of {name} has no size that can be drawn"
            )

    return Winner(
        run=run,
        robot=representation.robot,
        material=representation.material,
        tool=read.tool,
        name=read.tool.name or read.design_name or name,
        use=read.design_description or read.design_name,
    )


def size(tool: Tool, robot: Robot) -> str:
    """Say the extent along x, y and z, in millimetres, as the arm holds the tool."""
    if not tool.components:
        return "no tool"
    corners = [solid.vertices for _, solid in as_held(tool, robot)]
    extent = np.ptp(np.concatenate(corners), axis=0)
    return " × ".join(f"{1000 * side:.0f}" for side in extent) + " mm"

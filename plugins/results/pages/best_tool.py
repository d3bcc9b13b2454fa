"""The best tool in a run's store, as solids that can be drawn and printed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from omegaconf import OmegaConf

from core.config.compose import task_part, tool_part
from core.config.gate import take_stored
from core.design import Candidate, Tool
from core.errors import UserError
from core.interfaces import Material, Robot, Task, ToolRepresentation
from core.search.saved_designs import read_stored
from core.store.reader import StoredRun
from plugins.results.pages.drawing import as_held
from plugins.results.pages.runs import FinishedRun


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


def read_best(
    store: StoredRun, name: str, representation: ToolRepresentation, task: Task
) -> Candidate:
    """Read the best candidate of a run, which has this name, again.

    Raises:
        UserError: it is not among those that were tried, or the store is damaged.
    """
    for evaluation in store.evaluations():
        if evaluation.candidate == name and evaluation.status == "ok":
            design = store.designs()[evaluation.design_key]
            (candidate,) = read_stored(design, [evaluation], representation, task)
            return candidate

    raise UserError(f"its best candidate {name} is not among those that were tried")


def best_tool(run: FinishedRun) -> Winner:
    """Read the tool of a run's best candidate again.

    Raises:
        UserError: a part of the run is not installed here, or its store is missing or damaged.
    """
    kinds = ("task", "tool", "material", "robot")
    config, _ = take_stored(run.config, run.folder, kinds=kinds)
    settings = OmegaConf.create({kind: config.get(kind, {}) for kind in kinds})
    representation = tool_part(settings).create()
    task = task_part(settings).create()
    # It may break a rule: there were others when it was tried.
    name = run.best.candidate
    read = read_best(run.store, name, representation, task)
    if read.tool is None:
        raise UserError(f"the design of {name} can't be read again: {read.problem}")
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

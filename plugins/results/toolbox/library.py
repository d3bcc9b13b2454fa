"""Keep tools of finished runs in a folder, a library, and read them again."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from omegaconf import OmegaConf

from core.config.compose import task_part, tool_part
from core.config.gate import note_typed
from core.designs.reading import load_designs, read_designs
from core.errors import UserError
from core.store.library import (
    DESIGN,
    FACTS,
    KEPT_SETTINGS,
    KeptTool,
    list_library,
    read_kept,
)
from core.support.cli import write_bytes
from core.support.files import writing
from plugins.results.artifacts import save_design
from plugins.results.pages.runs import FinishedRun
from plugins.results.toolbox.held_tools import Cell, HeldTool
from plugins.results.workshop.maker import judge_tool


def keep_tool(run: FinishedRun, held: HeldTool, library: Path) -> Path:
    """Write a tool of a run to a library, in the place of the same tool; return its folder there.

    Raises:
        UserError: the folder can't be written.
    """
    folder = library / held.name
    representation = held.representation
    making = judge_tool(
        held.tool,
        representation.robot,
        representation.material,
        representation.printer,
    )
    # Of other candidates than the run's best it was not measured.
    is_best = held.candidate.id == run.best.candidate
    kept = KeptTool(
        tool=held.tool.name,
        earned={task: cell.reward for task, cell in held.earned.items()},
        unseen=run.figures.unseen.mean if run.figures.unseen and is_best else None,
        printable=making.words if making else "",
        run=str(run.folder),
        config={kind: held.config[kind] for kind in KEPT_SETTINGS},
    )

    note_typed(kept.config)
    with writing(library):
        save_design(held.candidate, representation, folder)
    text = json.dumps(asdict(kept), indent=2) + "\n"
    write_bytes(folder / FACTS, text.encode())

    return folder


def read_library(library: Path) -> list[HeldTool]:
    """Read the tools of a library, by name.

    Raises:
        UserError: a tool can't be read, or a part of it is not installed here.
    """
    return [_read_tool(folder) for folder in list_library(library)]


def _read_tool(folder: Path) -> HeldTool:
    kept, config = read_kept(folder)
    settings = OmegaConf.create(dict(config))
    task = task_part(settings).create()
    representation = tool_part(settings).create()
    design = folder / DESIGN
    candidate, *_ = read_designs(
        load_designs(design, within=folder), representation, task
    )
    if candidate.tool is None or candidate.problem is not None:
        raise UserError(f"{design} can't be used: {candidate.problem}")

    earned = {
        name: Cell(reward, candidate.of(name).plan)
        for name, reward in kept.earned.items()
    }
    return HeldTool(config, candidate, representation, earned)

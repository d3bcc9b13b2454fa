"""Keep tools of finished runs in a folder, a library, and read them again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from core.config.compose import task_part, tool_part
from core.config.trust import as_stored
from core.designs.reading import load_designs, read_designs
from core.errors import UserError
from core.store.rows import Id, Reward, parsed, validated
from core.support.cli import write_bytes
from core.support.files import read_untrusted, writing
from plugins.results.artifacts import save_design
from plugins.results.pages.runs import FinishedRun
from plugins.results.toolbox.held_tools import Cell, HeldTool
from plugins.results.toolbox.trials import OF_RUN
from plugins.results.workshop.remark import describe_printing

FACTS = "tool.json"
DESIGN = "design.json"
MAX_BYTES = 5_000_000


@dataclass(frozen=True)
class KeptTool:
    """What a library knows of a tool, beside its design.

    Attributes:
        tool: its name.
        earned: its rewards in the search, by task.
        unseen: the mean reward in layouts that the search never saw; None: it was not measured.
        printable: whether it can be printed, in words; empty: it has no parts.
        run: the folder of the run that found it.
        config: of the run, as far as a tool depends on it.
    """

    tool: str
    earned: dict[Id, Reward]
    unseen: Reward | None
    printable: str
    run: str
    config: dict[str, Any]


def keep_tool(run: FinishedRun, held: HeldTool, library: Path) -> Path:
    """Write a tool of a run to a library, in the place of the same tool; return its folder there.

    Raises:
        UserError: the folder can't be written.
    """
    folder = library / held.name
    representation = held.representation
    printable = describe_printing(
        held.tool, representation.robot, representation.material
    )
    # Of other candidates than the run's best it was not measured.
    is_best = held.candidate.id == run.best.candidate
    kept = KeptTool(
        tool=held.tool.name,
        earned={task: cell.reward for task, cell in held.earned.items()},
        unseen=run.figures.unseen.mean if run.figures.unseen and is_best else None,
        printable=printable or "",
        run=str(run.folder),
        config={kind: held.config[kind] for kind in (*OF_RUN, "task", "tool")},
    )

    with writing(library):
        save_design(held.candidate, representation, folder)
    text = json.dumps(asdict(kept), indent=2) + "\n"
    write_bytes(folder / FACTS, text.encode())

    return folder


def is_library(folder: Path) -> bool:
    """Report whether a folder is a library."""
    return any(folder.glob(f"*/{FACTS}"))


def read_library(library: Path) -> list[HeldTool]:
    """Read the tools of a library, by name.

    Raises:
        UserError: a tool can't be read, or a part of it is not installed here.
    """
    return [_read_tool(file) for file in sorted(library.glob(f"*/{FACTS}"))]


def _read_tool(file: Path) -> HeldTool:
    try:
        kept = validated(KeptTool, parsed(read_untrusted(file, MAX_BYTES)))
    except ValueError as error:
        raise UserError(f"{file}: {error}") from error

    lacks = {*OF_RUN, "task", "tool"} - kept.config.keys()
    if lacks:
        raise UserError(f"{file}: config lacks {min(lacks)}")

    config: Mapping[str, Any] = as_stored(kept.config, file)
    settings = OmegaConf.create(dict(config))
    task = task_part(settings).create()
    representation = tool_part(settings).create()
    design = file.with_name(DESIGN)
    candidate, *_ = read_designs(load_designs(design), representation, task)
    if candidate.tool is None or candidate.problem is not None:
        raise UserError(f"{design} can't be used: {candidate.problem}")

    earned = {
        name: Cell(reward, candidate.of(name).plan)
        for name, reward in kept.earned.items()
    }
    return HeldTool(config, candidate, representation, earned)

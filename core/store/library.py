"""Read a library of tools: a folder that holds one for each tool that finished runs found."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from core.config.gate import take_stored
from core.config.trust import as_stored
from core.errors import UserError
from core.store.rows import Id, Reward, parsed
from core.support.files import read_untrusted
from core.support.inputs import check

FACTS = "tool.json"
DESIGN = "design.json"
MAX_BYTES = 5_000_000
MOST_TOOLS = 1_000

OF_RUN = (
    "robot",
    "sim",
    "action",
    "material",
    "printer",
    "fitness",
    "rollout",
    "seed",
)
"""Settings of the run that its tool was tried with."""

KEPT_SETTINGS = (*OF_RUN, "task", "tool")
"""Settings of the run that are kept with its tool."""


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


def is_library(folder: Path) -> bool:
    """Report whether a folder is a library."""
    return any(folder.glob(f"*/{FACTS}"))


def list_library(library: Path) -> list[Path]:
    """List the folders of a library's tools, by name.

    Raises:
        UserError: there is no such folder, or it holds no tool.
    """
    if not library.is_dir():
        raise UserError(f"{library}: there is no such folder; {_hint(library)}")

    files = sorted(library.glob(f"*/{FACTS}"))
    if not files:
        raise UserError(f"{library} holds no tool; {_hint(library)}")

    if len(files) > MOST_TOOLS:
        raise UserError(
            f"{library} holds {len(files):,} tools, of at most {MOST_TOOLS:,}"
        )

    return [file.parent for file in files]


def _hint(library: Path) -> str:
    return f"keep tools in it with vlmgineer toolbox add RUN output={library}"


def read_facts(folder: Path) -> KeptTool:
    """Read what a library says of the tool in a folder; of its configuration nothing may be used yet (`read_kept`).

    Raises:
        UserError: it can't be read.
    """
    file = folder / FACTS
    try:
        kept = check(KeptTool, parsed(read_untrusted(file, MAX_BYTES, within=folder)))
    except ValueError as error:
        raise UserError(f"{file}: {error}") from error

    lacks = {*KEPT_SETTINGS} - kept.config.keys()
    if lacks:
        raise UserError(f"{file}: config lacks {min(lacks)}")

    return kept


def read_kept(
    folder: Path, kinds: Collection[str] | None = None
) -> tuple[KeptTool, Mapping[str, Any]]:
    """Read what a library knows of a tool, and the settings of its run, as they may be used (`core.config.gate`).

    Args:
        folder: of the tool.
        kinds: the sections of the settings that are used; None: all.

    Raises:
        UserError: it can't be read, or names something outside of the library that this user has not typed.
    """
    kept = read_facts(folder)
    stored = as_stored(kept.config, folder / FACTS)
    config, _ = take_stored(stored, folder, kinds=kinds)

    return kept, config

"""``vlmgineer inspect FOLDER [KEY=VALUE ...]``: say what a stranger's folder would do, and play its winner again.

Nothing that the folder names is run, asked or opened before the user types it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from core.config.compose import load, task_part, tool_part
from core.config.gate import find_strange, note_typed, take_stored
from core.config.trust import as_stored
from core.design import Candidate
from core.designs.reading import load_designs, read_designs
from core.errors import UsageError, UserError
from core.interfaces import VLM, Task, ToolRepresentation
from core.plugins import installed
from core.search.saved_designs import build_fitness, try_all
from core.store.database import FILE
from core.store.library import DESIGN, FACTS, KEPT_SETTINGS, read_facts
from core.store.reader import StoredRun
from core.support.cli import key_of, print_table, say
from core.support.templates import fill, macros
from core.support.text import hydra_word, number
from core.values.messages import Bill
from plugins.results.named_folders import folders_and_overrides
from plugins.results.pages.best_tool import read_best
from plugins.results.pages.runs import run_folders, short

USAGE = "usage: vlmgineer inspect FOLDER [KEY=VALUE ...]"
HELP = f"""{USAGE}

FOLDER is a run's, a tool's of a library, or holds some of these. What stands outside of it is used, to play its winner
again, only where you type it too; what you have typed once counts for this configuration on this machine from then on.
The exit status is 1 if a claim does not hold."""
MOST = 20  # runs and tools of a folder
TOLERANCE = 0.01
"""How far a reward that is played again may differ: other processors round otherwise."""

_MERGED = ("material", "printer", "rollout")  # settings that a store may lack some of

ReadWinner = Callable[[ToolRepresentation, Task], Candidate]


@dataclass(frozen=True, eq=False)
class Inspected:
    """What is known of a run or a tool without making any part of it.

    Attributes:
        folder: where it lies.
        says: what it says of itself, in lines.
        config: as it is stored.
        claims: rewards of its winner, by the task, or by its id.
        read: reads the winner.
        false: what does not fit together in it; empty: nothing.
    """

    folder: Path
    says: Sequence[str]
    config: dict[str, Any]
    claims: Mapping[str, float]
    read: ReadWinner
    false: str = ""


def main(words: list[str]) -> int:
    """Inspect the folder that the words name; return 1 if one of its claims does not hold.

    Raises:
        UserError: there is no such folder, or nothing of it can be read.
    """
    folders, typed = folders_and_overrides(HELP, words)
    if len(folders) != 1:
        raise UsageError(f"name one folder; {USAGE}")

    found = _find(folders[0])
    if len(found) > MOST:
        say(f"{len(found)} runs and tools are in it; the first {MOST} follow")

    return max(_inspect(folder, typed) for folder in found[:MOST])


def _find(folder: Path) -> list[Path]:
    """List the folders of tools and runs in a folder, or it alone.

    Raises:
        UserError: there is none.
    """
    if not folder.is_dir():
        raise UserError(f"{folder}: there is no such folder")

    facts = [folder / FACTS, *sorted(folder.glob(f"*/{FACTS}"))]
    tools = [file.parent for file in facts if file.exists()]
    found = [*tools, *run_folders(folder)]
    if not found:
        raise UserError(f"{folder} holds neither a run nor a tool of a library")

    return found


def _inspect(folder: Path, typed: Sequence[str]) -> int:
    """Say what one folder holds, and return the exit status."""
    is_run = (folder / FILE).exists()
    found = _read_run(folder) if is_run else _read_tool(folder)
    strange = find_strange(found.config)
    say(str(folder), *found.says)
    if strange:
        say("it names what is outside of it, and of the program:")
        rows = [(s.path, s.what, hydra_word(s.value)) for s in strange]
        print_table(("setting", "what it is", "value"), rows)
    else:
        say("it names nothing outside of the program that you have not typed here")

    if found.false:
        say(found.false)

    given = set(map(key_of, typed))
    try:
        usable, _ = take_stored(found.config, folder, typed, KEPT_SETTINGS)
        holds = _compare(found, usable)
    except UserError as error:
        say(f"not played again: {error}")
        return 1

    if strange and all(setting.path in given for setting in strange):
        note_typed(found.config)
        say("you have typed all of it: it is known here from now on")

    return 0 if holds and not found.false else 1


def _read_run(folder: Path) -> Inspected:
    """Read what a run says of itself.

    Raises:
        UserError: it can't be read.
    """
    store = StoredRun(folder)
    config = store.config()
    if not config:
        raise UserError(f"{folder} holds a run that ended before it began")

    result = store.result()
    evaluations = store.evaluations()
    best = result.best if result is not None else None
    claims = {} if best is None else {best.candidate: best.reward}
    ended = result is not None
    stopped = short(result.stopped or "") if result is not None else ""
    words = macros("plugins.results", "words")
    says = [
        words.run(config, len(evaluations), stopped, ended),
        _describe_money(store, config),
    ]
    if best is not None and best.second_engine is not None:
        there = best.second_engine
        says.append(
            f"it says that its winner earns {number(there.reward, 3)} in {there.engine}"
        )

    def read(representation: ToolRepresentation, task: Task) -> Candidate:
        assert best is not None, "there is a claim"
        return read_best(store, best.candidate, representation, task)

    false = store.find_false_claim()
    return Inspected(folder, says, config, claims, read, false)


def _describe_money(store: StoredRun, config: Mapping[str, Any]) -> str:
    """Say which model is asked when the run goes on, how often, and what limits it."""
    vlm = config["vlm"]
    try:
        factory = installed().factory("vlm", vlm["name"])
    except UserError as error:
        return f"its model can't be asked here: {error}"
    if not getattr(factory, "sees", VLM.sees):
        return "going on costs nothing: its model computes what it answers"

    budget = config["budget"]
    answers = [reply for _, reply in store.answers()]
    most = budget["n_agent"] * (budget["n_iteration"] + 1)
    paid = Bill.of(answers).cost_usd
    return fill(
        "plugins.results",
        "going_on",
        model=short(str(vlm.get("model") or vlm["name"])),
        vlm=vlm,
        answers=answers,
        most=most,
        paid=math.nan if paid is None else paid,
    )


def _read_tool(folder: Path) -> Inspected:
    """Read what a library says of a tool.

    Raises:
        UserError: it can't be read.
    """
    facts = read_facts(folder)

    def read(representation: ToolRepresentation, task: Task) -> Candidate:
        document = load_designs(folder / DESIGN, within=folder)
        return read_designs(document, representation, task)[0]

    says = [f"a tool of a library: {short(facts.tool)}"]
    config = as_stored(facts.config, folder / FACTS)
    return Inspected(folder, says, config, facts.earned, read)


def _compare(found: Inspected, usable: Mapping[str, Any]) -> bool:
    """Play a winner again, and say what it earns beside what is claimed; return whether that holds.

    Raises:
        UserError: a part can't be used here, or the winner can't be read.
    """
    if not found.claims:
        say("it claims no reward")
        return True

    cfg = _configure(usable)
    task = task_part(cfg).create()
    candidate = found.read(tool_part(cfg).create(), task)
    if candidate.problem is not None:
        raise UserError(candidate.problem)

    (evaluation,) = try_all(cfg, [candidate], build_fitness(cfg))
    if evaluation.reason:
        say(short(evaluation.reason))

    holds = True
    for name, claimed in found.claims.items():
        earned = evaluation.reward
        if name in [part.name for part in task.parts]:
            earned = evaluation.in_task(name).reward
        holds &= abs(earned - claimed) <= TOLERANCE
        say(f"{short(name)} claims {number(claimed, 3)}, replays {number(earned, 3)}")

    return holds


def _configure(usable: Mapping[str, Any]) -> DictConfig:
    """Compose what a winner is played with: on this machine, by workers that have limits."""
    cfg = load("config", ["executor=local", "executor.workers=1"])
    for kind in KEPT_SETTINGS:
        OmegaConf.update(cfg, kind, usable[kind], merge=kind in _MERGED)

    return cfg

"""Are rewards bit for bit what they were? ``python -m tests.benchmarks.golden record folder=before`` with the old code,
``record folder=after like=before`` with the new, then ``compare before after``.

Each engine tries the tasks' reference solutions and ``designs`` designs a task. ``compare`` prints how many rewards
differ by task and engine; if one differs or is missing, it ends with an error.
"""

from __future__ import annotations

import json
import math
import shutil
import sys
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from core.config.compose import engines
from core.design import Candidate
from core.designs.reading import dump_design, load_designs, read_designs
from core.errors import UsageError, UserError
from core.interfaces import Executor
from core.plugins import PluginPart, installed
from core.support.cli import command
from core.trial import Condition
from plugins.commands.evaluate import record as entry
from tests.benchmarks import measuring
from tests.support.playing import evaluate_all

USAGE = (
    "usage: python -m tests.benchmarks.golden record folder=DIR [like=DIR] [sims=NAME,NAME,...] [tasks=NAME,...] "
    "[designs=N] [seed=N] [workers=N], or: python -m tests.benchmarks.golden compare BEFORE AFTER"
)


PLANS = 4  # of a tool


@dataclass
class Settings:
    """``like``: the folder whose designs are used; the default is new ones."""

    folder: str = "golden"
    like: str | None = None
    sims: list[str] = field(default_factory=lambda: ["pybullet", "sapien", "mujoco"])
    tasks: list[str] = field(default_factory=list)
    designs: int = 20
    seed: int = 0
    workers: int | None = None


def main() -> None:
    match sys.argv[1:]:
        case ["--help" | "-h"]:
            sys.stdout.write(f"{USAGE}\n")
        case ["record", *words]:
            record(measuring.settings(words, Settings))
        case ["compare", before, after]:
            compare(Path(before), Path(after))
        case _:
            raise UsageError(USAGE)


def record(given: Settings) -> None:
    """Keep the rewards in ``designs/TASK.json``, ``rewards/TASK.json`` and ``solutions/TASK.SIM.json``."""
    names = measuring.tasks(given.tasks)
    sims = engines(given.sims)
    folder = Path(given.folder)
    if given.like is not None:
        if not (source := Path(given.like) / "designs").is_dir():
            raise UserError(f"like={given.like}: there is no folder {source}")
        shutil.copytree(source, folder / "designs", dirs_exist_ok=True)
    with measuring.executor(measuring.workers(given.workers)) as executor:
        for name in names:
            candidates = designs(
                name, given.designs, given.seed, folder / "designs" / f"{name}.json"
            )
            for shown, sim in sims.items():
                measuring.rewards(
                    name,
                    candidates,
                    sim,
                    given.seed,
                    executor,
                    folder / "rewards" / f"{name}.json",
                )
                solve(
                    name, sim, executor, folder / "solutions" / f"{name}.{shown}.json"
                )


def designs(task: str, count: int, seed: int, file: Path) -> list[Candidate]:
    """Read the designs of a task from a file, which is written if it is not there.

    Raises:
        UserError: the file has those of another seed.
    """
    form = installed().create("tool", "urdf")
    if not file.exists():
        made = measuring.designs(
            task, math.ceil(count / PLANS), min(count, PLANS), seed
        )
        file.parent.mkdir(parents=True, exist_ok=True)
        measuring.save(
            file,
            {
                "task": task,
                "seed": seed,
                "strategies": [dump_design(c, form) for c in made],
            },
        )
    known = json.loads(file.read_text(encoding="utf-8"))["seed"]
    if known != seed:
        raise UserError(
            f"{file} has other designs, of seed={known}; choose another folder=..."
        )
    return read_designs(load_designs(file), form, installed().create("task", task))


def solve(task: str, sim: PluginPart, executor: Executor, file: Path) -> None:
    """Try the task's reference solution, if it has one and the file is not there yet."""
    solution = measuring.SOLUTIONS / f"{task}.json"
    if file.exists() or not solution.exists():
        return
    made = installed().create("task", task)
    candidates = read_designs(
        load_designs(solution), installed().create("tool", "urdf"), made
    )
    evaluations = evaluate_all(
        candidates, Condition(PluginPart("task", task), sim), executor
    )
    file.parent.mkdir(parents=True, exist_ok=True)
    measuring.save(
        file,
        [entry(e, made) for e in sorted(evaluations, key=lambda e: e.candidate.key)],
    )


def compare(before: Path, after: Path) -> None:
    """Print a row for each task and engine.

    Raises:
        UserError: a reward differs or is missing, the designs differ, or there is nothing to compare.
    """
    for file in before.glob("designs/*.json"):
        other = after / "designs" / file.name
        if (
            other.exists()
            and load_designs(other)["strategies"] != load_designs(file)["strategies"]
        ):
            raise UserError(
                f"{other} has other designs than {file}; record again with like={before}"
            )
    old = read(before)
    new = read(after)
    lines = [
        "| task | engine | rewards | differ | missing | largest difference |",
        "|---|---|---|---|---|---|",
    ]
    total: Counter[str] = Counter()
    for task, engine in sorted({key[:2] for key in old}):
        keys = [key for key in old if key[:2] == (task, engine)]
        pairs = [(old[key], new[key]) for key in keys if key in new]
        differing = [
            abs(one - other) for one, other in pairs if one.hex() != other.hex()
        ]
        row = {
            "rewards": len(keys),
            "differ": len(differing),
            "missing": len(keys) - len(pairs),
        }
        lines.append(
            f"| {task} | {engine} | {' | '.join(map(str, row.values()))} | {max(differing, default=0):.3g} |"
        )
        total.update(row)
    sys.stdout.write("\n".join(lines) + "\n")
    if not total["rewards"] or total["differ"] or total["missing"]:
        raise UserError(
            f"{after}: of {total['rewards']} rewards {total['differ']} differ, {total['missing']} missing"
        )


def read(folder: Path) -> dict[tuple[str, str, str], float]:
    """Load every reward of a folder, by task, engine, and solution or design."""
    found = {}
    for file in folder.glob("solutions/*.json"):
        task, engine = file.stem.split(".", 1)
        for number, item in enumerate(json.loads(file.read_text())):
            found[task, engine, f"solution {number}"] = float(item["reward"])
    for file in folder.glob("rewards/*.json"):
        for item in json.loads(file.read_text()):
            for number, reward in enumerate(item["rewards"]):
                found[file.stem, item["engine"]["name"], f"design {number}"] = float(
                    reward
                )
    return found


if __name__ == "__main__":
    command(lambda _: main())

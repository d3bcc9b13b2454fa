"""Did a change cost time beside the engine's steps? ``python -m tests.benchmarks.overhead BEFORE AFTER``.

Each of two commits is checked out into a temporary folder and measured there by its own
`tests.benchmarks.throughput`, in turns and with the packages that are installed here. Both try the same designs, those
of the first commit's embedded designer: other motions take the engine another time. With ``designs=own`` each tries
those of its own. The table has the mean over ``rounds`` for each engine: workers x wall time / the engine's time, its
least and greatest, and candidates per second.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from statistics import mean
from typing import Any

from rich.table import Table

from core.errors import UsageError, UserError, choices
from core.support.cli import command
from tests.benchmarks import measuring

USAGE = (
    "usage: python -m tests.benchmarks.overhead BEFORE AFTER [sims=NAME,NAME,...] [tasks=NAME,...] [rounds=N] "
    "[workers=N] [tools=N] [plans=N] [designs=before|own]"
)
ROOT = Path(__file__).parents[2]
DESIGNS = ("before", "own")

# What a commit's benchmark is started by: its designer answers with what a file has, or the file gets its answer.
_WITH_REPLY = """
import runpy, sys
from dataclasses import replace
from pathlib import Path
from core.plugins import installed

file = Path(sys.argv.pop(1))
designer = type(installed().create("vlm", "offline"))
ask = designer.complete

def complete(self, requests):
    (reply,) = ask(self, requests)
    if not file.exists():
        file.write_text(reply.text)
    return [replace(reply, text=file.read_text())]

designer.complete = complete
runpy.run_module("tests.benchmarks.throughput", run_name="__main__", alter_sys=True)
"""


@dataclass
class Settings:
    """``tools`` and ``plans`` are those of a population; each round measures it once at each commit.

    ``designs``: whose are tried: those of the commit ``before`` at both, or each commit's ``own``.
    """

    sims: list[str] = field(default_factory=lambda: ["pybullet", "sapien", "mujoco"])
    tasks: list[str] = field(default_factory=lambda: ["BringCube"])
    rounds: int = 2
    workers: int | None = None
    tools: int = 20
    plans: int = 10
    designs: str = "before"


def main(words: list[str]) -> None:
    if words[:1] in (["--help"], ["-h"]):
        sys.stdout.write(f"{USAGE}\n")
        return
    if len(words) < 2 or any("=" in word for word in words[:2]):
        raise UsageError(USAGE)
    given = measuring.settings(words[2:], Settings)
    if given.rounds < 1:
        raise UsageError(f"rounds must be at least 1, got {given.rounds}")
    if given.designs not in DESIGNS:
        raise choices("designs", given.designs, DESIGNS)
    table = Table("task", "engine", "commit", "overhead", "driving", "candidates/s")
    with (
        tempfile.TemporaryDirectory() as folder,
        checked_out(words[:2], Path(folder)) as trees,
    ):
        for task in measuring.tasks(given.tasks):
            for sim in given.sims:
                rounds = [
                    {
                        commit: measure(tree, task, sim, given)
                        for commit, tree in trees.items()
                    }
                    for _ in range(given.rounds)
                ]
                for commit in trees:
                    table.add_row(
                        task, sim, commit, *summarise([each[commit] for each in rounds])
                    )
    measuring.console.file = sys.stdout
    measuring.console.print(table)


@contextmanager
def checked_out(commits: list[str], folder: Path) -> Iterator[dict[str, Path]]:
    """Check out commits into a folder, by their names; each gets the entry points that it has itself.

    Raises:
        UserError: Git does not know a commit.
    """
    trees = dict[str, Path]()
    try:
        for number, commit in enumerate(dict.fromkeys(commits)):
            tree = folder / str(number)
            _git("worktree", "add", "--quiet", "--detach", str(tree), commit)
            trees[commit] = tree
            _declare(tree)
        yield trees
    finally:
        for tree in trees.values():
            _git("worktree", "remove", "--force", str(tree))


def _git(*words: str) -> None:
    done = subprocess.run(
        ["git", "-C", str(ROOT), *words], capture_output=True, text=True
    )
    if done.returncode != 0:
        raise UserError(f"git {' '.join(words[:2])}: {done.stderr.strip()}")


def _declare(tree: Path) -> None:
    """Write the metadata of an installed distribution beside the code, so that this tree's entry points are found."""
    project = tomllib.loads((tree / "pyproject.toml").read_text())["project"]
    lines = list[str]()
    for group, entries in project.get("entry-points", {}).items():
        lines += [
            f"[{group}]",
            *(f"{name} = {value}" for name, value in entries.items()),
        ]
    info = tree / f"{project['name']}-0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 0\n"
    )
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")


def measure(tree: Path, task: str, sim: str, given: Settings) -> dict[str, Any]:
    """Run the throughput benchmark of a checked out commit.

    Raises:
        UserError: it broke.
    """
    output = tree / "throughput.json"
    starter = ["-m", "tests.benchmarks.throughput"]
    if given.designs == "before":
        starter = ["-c", _WITH_REPLY, str(tree.parent / f"{task}.reply")]

    words = [
        f"task={task}",
        f"sim={sim}",
        f"tools={given.tools}",
        f"plans={given.plans}",
    ]
    words += [f"workers={measuring.workers(given.workers)}", f"output={output}"]
    done = subprocess.run(
        [sys.executable, *starter, *words],
        cwd=tree,
        env=os.environ | {"PYTHONPATH": str(tree)},
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        raise UserError(
            f"the benchmark broke at {tree.name}: {(done.stderr.strip() or '?').splitlines()[-1]}"
        )
    found: dict[str, Any] = json.loads(output.read_text())
    return found


def summarise(found: list[dict[str, Any]]) -> tuple[str, str, str]:
    """Return overhead, share of driving, and candidates per second over the rounds of one commit."""
    overheads = [each["overhead"] for each in found]
    shown = f"{mean(overheads):.2f} ({min(overheads):.2f} to {max(overheads):.2f})"
    driving = mean(each["shares"]["driving"] for each in found)
    return (
        shown,
        f"{driving:.0%}",
        f"{mean(each['rollouts_per_s'] for each in found):.2f}",
    )


if __name__ == "__main__":
    command(main)

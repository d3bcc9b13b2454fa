"""What a run of very many candidates costs the parent: ``python -m tests.benchmarks.load FOLDER candidates=N``.

Nothing is played. The strategy repeats a tool with plans that all differ, and the executor gives results at once. Left
is what the parent does for each candidate: dealing it out, storing it, ranking it. Then the run is resumed as if it had
been killed at its end, reported on, and its store is read once. Each step has its processor seconds.
"""

from __future__ import annotations

import json
import resource
import sqlite3
import sys
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from omegaconf import OmegaConf

from core.config.compose import load
from core.errors import UsageError
from core.interfaces import EvolutionStrategy, Executor
from core.plugins import Offer, installed
from core.search.orchestration import run
from core.store.reader import StoredRun
from core.store.recorder import RunStore
from core.support.cli import command
from core.trial import Trial
from core.values.plans import Waypoints
from plugins.results.report.report_command import report
from tests.benchmarks import measuring

USAGE = "usage: python -m tests.benchmarks.load FOLDER [candidates=N] [generation=N]"
PER_TOOL = 10


@dataclass
class Settings:
    """``candidates`` in all, ``generation`` of them in each generation."""

    candidates: int = 10_000
    generation: int = 1_000


class Repeating(EvolutionStrategy):
    """Gives the reference solution's tool, with plans that differ by less than a millimetre."""

    def __init__(self, designer, budget, size: int = 1_000) -> None:
        super().__init__(designer, budget)
        self.size = size
        self._generation = 0
        self._pattern = measuring.designs("BringCube", 1, 1, 0)[0]

    def ask(self):
        poses = self._pattern.plan.poses
        for number in range(self.size):
            serial = self._generation * self.size + number
            yield replace(
                self._pattern,
                generation=self._generation,
                agent=0,
                design=number // PER_TOOL,
                action=number % PER_TOOL,
                plan=Waypoints(poses + serial * 1e-10),
            )

    def tell(self, evaluations) -> None:
        self._generation += 1


class Nothing(Executor):
    """Gives a result for each chunk at once, whose rewards follow from the plan."""

    def map(self, function, chunks):
        for chunk in chunks:
            yield (
                chunk,
                [
                    Trial(
                        chunk.condition.where,
                        candidate.id,
                        reward=int(candidate.content[:8], 16) % 997 / 1000,
                        measured={"distance_m": 1.0, "motion_s": 5.0},
                        moved_m={"cube": 0.1},
                        outcome="the cube moved 0.10 m",
                    )
                    for candidate in chunk
                ],
            )

    def close(self) -> None: ...


def offer() -> None:
    for kind, name, factory in (
        ("evolution", "repeating", Repeating),
        ("executor", "nothing", Nothing),
    ):
        installed().offers[kind, name] = Offer(kind, name, "load", "tests", factory)


def measure(step: str, action: Callable[[], object]) -> dict[str, float | str]:
    """Run a step; return its seconds, and the most memory that this process has had."""
    processor, began = time.process_time(), time.monotonic()
    action()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    row: dict[str, float | str] = {
        "step": step,
        "processor_s": round(time.process_time() - processor, 2),
        "wall_s": round(time.monotonic() - began, 2),
        "peak_mb": round(peak),
    }
    sys.stdout.write(json.dumps(row) + "\n")
    sys.stdout.flush()
    return row


def forget_end(folder: Path) -> None:
    """Make a store what it is of a run that was killed at its end."""
    with closing(sqlite3.connect(folder / "run.sqlite")) as database, database:
        database.execute("UPDATE run SET result = NULL")


def resume(cfg, folder: Path) -> None:
    store = RunStore.open(folder)
    assert store is not None
    run(cfg, folder, store)


def read(folder: Path) -> None:
    StoredRun(folder).evaluations()


def main(words: list[str]) -> None:
    if not words or "=" in words[0] or words[0].startswith("-"):
        raise UsageError(USAGE)
    folder = Path(words[0])
    given = measuring.settings(words[1:], Settings)
    offer()
    generations = given.candidates // given.generation
    cfg = load(
        "config",
        ["task=BringCube", "sim=mujoco", "film=false", "listener=[]", "budget.final_s=0",
         f"budget.n_iteration={generations - 1}"],
    ).copy()  # fmt: skip
    parts = {
        "evolution": {"name": "repeating", "size": given.generation},
        "executor": {"name": "nothing"},
    }
    for kind, settings in parts.items():
        OmegaConf.update(cfg, kind, settings, merge=False)

    measure("run", lambda: run(cfg, folder / "run"))
    size = sum(file.stat().st_size for file in (folder / "run").glob("run.sqlite*"))
    sys.stdout.write(json.dumps({"store_mb": round(size / 1e6, 1)}) + "\n")
    # Like a resume or a report, in a process that has the memory of the run.
    forget_end(folder / "run")
    measure("resume", lambda: resume(cfg, folder / "run"))
    measure("report", lambda: report([folder / "run"], folder / "report"))
    measure("read", lambda: read(folder / "run"))


if __name__ == "__main__":
    command(main)

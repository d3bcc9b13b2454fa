"""What a week does to a run, in minutes: ``python -m tests.benchmarks.week FOLDER candidates=N``.

Designs are drawn at random and an engine that does next to nothing plays them, in real worker processes. Meanwhile:

- the engine keeps 20 megabytes of each rollout, so that workers run out of memory (``executor.memory_mb``);
- the fortieth rollout of every second worker never ends (``executor.timeout_s``);
- the disk is full several times, and is given room while the run waits (``patience_s``);
- the model answers nothing for a whole generation, until the run has waited for an hour;
- the clock jumps by an hour, forth and back, each time it is read.

The same run without all this comes first. Said is what happened, and whether both come to the same. Root on Linux only.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from omegaconf import DictConfig, OmegaConf

from core.errors import UsageError
from core.search import patience
from core.search.orchestration import run_and_print
from core.store.reader import StoredRun
from core.support.cli import command
from tests.benchmarks import measuring
from tests.benchmarks.load import measure
from tests.support import toys

USAGE = "usage: python -m tests.benchmarks.week FOLDER [candidates=N] [generations=N]"
AGENTS, TOOLS = 4, 5
"""Three agents of four answer with designs."""

ROOM = 4  # times that the disk is given more, or so
HOUR_S = 3600.0
DIFFER = ("wall_time_s", "rollouts_per_s", "sim")


@dataclass
class Settings:
    """``candidates`` that are asked for in all, in so many ``generations``."""

    candidates: int = 2_000
    generations: int = 5


class Disk:
    """A disk in memory, that grows when it is asked to."""

    def __init__(self, folder: Path, step_kb: int) -> None:
        self.folder = folder
        self.grown = 0
        self._step_kb = step_kb
        self._mount("-t", "tmpfs", "-o", self._size(), "week")

    def grow(self) -> None:
        self.grown += 1
        self._mount("-o", f"remount,{self._size()}")

    def is_full(self) -> bool:
        return shutil.disk_usage(self.folder).free < 100_000

    def _size(self) -> str:
        return f"size={(1 + self.grown) * self._step_kb}k"

    def _mount(self, *words: str) -> None:
        subprocess.run(["mount", *words, str(self.folder)], check=True)

    def end(self) -> None:
        subprocess.run(["umount", "-l", str(self.folder)], check=True)


def configure(notes: Path, given: Settings, sim: dict[str, str]) -> DictConfig:
    plans = given.candidates // (given.generations * AGENTS * TOOLS)
    cfg = toys.config(
        notes,
        *(f"budget.n_agent={AGENTS}", f"budget.n_tool={TOOLS}"),
        *(f"budget.n_action={plans}", f"budget.n_iteration={given.generations - 1}"),
    )
    executor = {"name": "local", "workers": 2, "timeout_s": 5.0, "memory_mb": 1500}
    OmegaConf.update(cfg, "executor", executor, merge=False)
    OmegaConf.update(cfg, "sim", sim, merge=False)
    OmegaConf.update(cfg, "patience_s", 2 * HOUR_S, force_add=True)
    return cfg


def wait(cfg: DictConfig, disk: Disk, waited: list[float]) -> Callable[[float], None]:
    """Return what is done in place of a wait: room is made, or the model comes back after an hour."""

    def sleep(seconds: float) -> None:
        if disk.is_full():
            disk.grow()
            return
        waited.append(seconds)
        if sum(waited) >= HOUR_S:
            OmegaConf.update(cfg, "vlm.down", "")

    return sleep


def jumping(clock: Callable[[], float]) -> Callable[[], float]:
    """Return a clock that is an hour ahead at each second look."""
    looks = [0]

    def read() -> float:
        looks[0] += 1
        return clock() + HOUR_S * (looks[0] % 2)

    return read


def find_result(folder: Path) -> dict[str, Any]:
    result = json.loads((folder / "result.json").read_text())
    return {key: value for key, value in result.items() if key not in DIFFER}


def main(words: list[str]) -> None:
    if not words or "=" in words[0] or words[0].startswith("-"):
        raise UsageError(USAGE)
    folder = Path(words[0]).absolute()
    given = measuring.settings(words[1:], Settings)
    install(folder / "site")
    calm, rough = folder / "calm", folder / "rough"
    rough.mkdir(parents=True)

    cfg = configure(folder / "calm_notes", given, {"name": "toy"})
    measure("calm", lambda: run_and_print(cfg, calm))
    stored_kb = sum(file.stat().st_size for file in calm.rglob("*")) // 1000

    notes = folder / "rough_notes"
    cfg = configure(notes, given, {"name": "hard", "notes": str(notes)})
    OmegaConf.update(cfg, "vlm.down", "g1-.*", force_add=True)
    disk = Disk(rough, max(500, stored_kb // ROOM))
    waited: list[float] = []
    plain_clock = time.time
    time.time = jumping(time.time)
    patience.time = SimpleNamespace(sleep=wait(cfg, disk, waited))
    try:
        measure("rough", lambda: run_and_print(cfg, rough / "run"))
        stored = StoredRun(rough / "run")
        report = {
            "candidates": len(stored.evaluations()),
            "the disk was full": disk.grown,
            "waits for the model": len(waited),
            "rollouts that hung": len(toys.Notes(str(notes)).lines("hung")),
            "workers without memory": len(toys.Notes(str(notes)).lines("full")),
            "requests asked twice": count_twice(notes),
            "the same result": find_result(calm) == find_result(rough / "run"),
        }
        sys.stdout.write(json.dumps(report) + "\n")
    finally:
        time.time, patience.time = plain_clock, time
        disk.end()


def install(site: Path) -> None:
    """Install this file as a plugin, which worker processes find as well."""
    notes = site / "week-1.0.dist-info"
    notes.mkdir(parents=True)
    (notes / "METADATA").write_text("Metadata-Version: 2.1\nName: week\nVersion: 1.0\n")
    (notes / "entry_points.txt").write_text(
        "[vlmgineer]\nweek = tests.benchmarks.week_engine\n"
    )
    sys.path.insert(0, str(site))


def count_twice(notes: Path) -> int:
    asked = toys.Notes(str(notes)).lines("asked")
    return len(asked) - len(set(asked))


if __name__ == "__main__":
    command(main)

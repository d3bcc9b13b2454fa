"""Run folders, read without a change: the result of a run as its store has it, or why it has none."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from core.config.trust import read_stored_yaml
from core.errors import UserError
from core.store.database import FILE, is_held
from core.store.reader import StoredEvaluation, StoredRun
from core.store.rows import Best, RunFigures
from core.support.text import by_reason, clean

RESULT = "result.json"
HYDRA = ".hydra"
MAX_DEPTH = 6  # of a run's folder below one that the user names

_LONGEST = 300


@dataclass(frozen=True, eq=False)
class FinishedRun:
    """A run that ended and has a best candidate. ``config`` is all of its configuration, resolved."""

    folder: Path
    figures: RunFigures
    config: dict[str, Any]

    @property
    def store(self) -> StoredRun:
        return StoredRun(self.folder)

    @property
    def task(self) -> str:
        return self.figures.task

    @property
    def seed(self) -> int:
        return self.figures.seed

    @property
    def best(self) -> Best:
        assert self.figures.best is not None
        return self.figures.best

    @property
    def rollouts(self) -> int:
        return (
            self.figures.n_evaluations
            if self.figures.rollouts is None
            else self.figures.rollouts
        )

    def best_so_far(self, length: int) -> list[float]:
        """The best reward up to and with each of ``length`` generations; a run that stopped early keeps its last."""
        so_far = list(
            itertools.accumulate(
                (g.best_reward or 0.0 for g in self.figures.generations), max
            )
        ) or [0.0]
        return (so_far + so_far[-1:] * length)[:length]

    def recordings(self) -> dict[str, Path]:
        """The recordings and the films that it left, by what they are; of several tasks each has its own."""
        found = {
            file.stem: file
            for file in sorted(self.folder.glob("recording*.rrd"))
            if self._holds(file)
        }
        return found | {
            f"film {film.parent.name}".removesuffix(" best"): film
            for film in self.films()
        }

    def films(self) -> list[Path]:
        """The films of the best candidate, one for each of its tasks."""
        best = self.folder / "best"
        return [
            file
            for file in (best / "rollout.gif", *sorted(best.glob("*/rollout.gif")))
            if self._holds(file)
        ]

    def _holds(self, file: Path) -> bool:
        return file.is_file() and file.resolve().is_relative_to(self.folder.resolve())


@dataclass(frozen=True, eq=False)
class LeftOutRun:
    """A run that no figure counts, and the reason."""

    folder: Path
    status: Literal["unfinished", "failed", "unreadable"]
    reason: str
    task: str = ""
    config: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.status}: {short(str(self.folder))}: {self.reason}"


def find_runs(folders: Sequence[Path]) -> tuple[list[FinishedRun], list[LeftOutRun]]:
    """Find the runs in ``folders``, each a run's own or one that holds runs, in order; those of a multirun by number.

    Raises:
        UserError: a folder is missing, or holds no run.
    """
    runs: dict[Path, FinishedRun | LeftOutRun] = {}
    for folder in folders:
        if not folder.is_dir():
            raise UserError(
                f"no folder {folder}; give the folder of a run or of a multirun"
            )
        paths = run_folders(folder)
        if not paths:
            raise UserError(
                f"{folder} holds no run: neither {RESULT} nor {FILE} is in it or below it"
            )
        for path in paths:
            if path.resolve() not in runs:
                runs[path.resolve()] = read_run(path)
    finished = [run for run in runs.values() if isinstance(run, FinishedRun)]
    return finished, [run for run in runs.values() if isinstance(run, LeftOutRun)]


def run_folders(folder: Path, depth: int = MAX_DEPTH) -> list[Path]:
    """Find the run folders at or below ``folder``; one with Hydra's files and nothing else is of a run that failed."""
    try:
        entries = {entry.name: entry for entry in os.scandir(folder)}
    except OSError as error:
        raise UserError(f"{folder} can't be read: {error.strerror}") from error
    if {FILE, RESULT} & entries.keys():
        return [folder]
    skipped = (HYDRA, "best", "requests", "replies")
    below = [
        name
        for name, entry in entries.items()
        if entry.is_dir(follow_symlinks=False) and name not in skipped
    ]
    names = sorted(below, key=natural) if depth > 0 else []
    runs = [path for name in names for path in run_folders(folder / name, depth - 1)]
    return runs or [folder] * (HYDRA in entries)


def natural(name: str) -> list[tuple[int, int | str]]:
    """A sort key that orders numbers in names by their size."""
    return [
        (0, int(word)) if word.isdigit() else (1, word)
        for word in re.split(r"(\d+)", name)
        if word
    ]


def read_run(folder: Path) -> FinishedRun | LeftOutRun:
    """Read a run from its folder."""
    store = StoredRun(folder)
    if (folder / FILE).is_symlink():
        return LeftOutRun(
            folder, "unreadable", f"{FILE} is a link, which is not followed"
        )
    if not store.exists:
        config = _stored(folder / HYDRA / "config.yaml")
        reason = f"it has no {FILE}: it ended before it began, or that was deleted"
        return LeftOutRun(folder, "failed", reason, _task(folder, config), config)
    try:
        config = store.config()
        figures = store.result()
    except UserError as error:
        return LeftOutRun(folder, "unreadable", short(str(error)))
    if figures is None:
        config = config or _stored(folder / HYDRA / "config.yaml")
        return LeftOutRun(
            folder,
            "unfinished",
            _progress(folder, store),
            _task(folder, config),
            config,
        )
    if figures.stopped is not None:
        return LeftOutRun(
            folder,
            "unfinished",
            short(f"stopped: {figures.stopped}"),
            figures.task,
            config,
        )
    if figures.best is None:
        first = next(
            (
                f"; the first reason: {e.reason}"
                for e in store.evaluations()
                if e.status != "ok"
            ),
            "",
        )
        return LeftOutRun(
            folder,
            "failed",
            f"no candidate could be tried{short(first)}",
            figures.task,
            config,
        )
    return FinishedRun(folder, figures, config)


def short(text: str) -> str:
    return clean(text, _LONGEST)


def _task(folder: Path, config: dict[str, Any]) -> str:
    """Name the task of a run without a result; one of a scene file is named as the run's copy says."""
    chosen = _stored(folder / "task.yaml") or config.get("task")
    name = chosen.get("name") if isinstance(chosen, dict) else None
    return short(name) if isinstance(name, str) else ""


def _stored(file: Path) -> dict[str, Any]:
    """A YAML file of a run; empty if it can't be read, so that the run is listed without what it says."""
    try:
        return read_stored_yaml(file)
    except UserError:
        return {}


def _progress(folder: Path, store: StoredRun) -> str:
    """The progress of an unfinished run, in words."""
    try:
        evaluations = store.evaluations()
        generations = len(store.generations())
    except UserError as error:
        return short(str(error))
    best = max((e.reward for e in evaluations if e.status == "ok"), default=None)
    reached = "" if best is None else f", best reward so far {best:.3f}"
    how = "goes on" if is_held(folder) else "was killed"
    return f"{generations} generations and {len(evaluations)} candidates done{reached}; it {how}"


def reasons(store: StoredRun) -> list[str]:
    """Why candidates were rejected, failed, or earned less than their rollout did or nothing, by candidate."""
    return by_reason(
        (e.candidate, e.reason or _why_zero(e)) for e in store.evaluations()
    )


def _why_zero(evaluation: StoredEvaluation) -> str:
    """The reason why a candidate earned nothing, as far as its rollouts were observed; empty: it earned something."""
    if evaluation.status != "ok" or evaluation.reward > 0:
        return ""
    seen = {
        trial.observation.result
        for trial in evaluation.trials
        if trial.observation is not None
    }
    return f"earned nothing{': ' if seen else ''}{', '.join(sorted(seen))}"

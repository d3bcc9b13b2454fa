"""Run folders, read without a change: the result of a run as its store has it, or why it has none."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from filelock import FileLock, Timeout

from core.errors import UserError
from core.store.database import FILE, LOCK
from core.store.reader import StoredRun
from core.store.rows import Best, RunFigures
from core.support.files import read_untrusted
from core.support.templates import macros
from core.support.text import Reason, by_reason, clean

RESULT = "result.json"
HYDRA = ".hydra"
MAX_BYTES = 100_000  # of a scene file
EVENTS = "events.txt"
"""Beside a film: what its looks saw and how its guards ended, a line each."""

MAX_EVENTS = 64
"""Of a film; a plan comes to at most 40 looks and 24 guards."""

MAX_DEPTH = 6
"""Of a run's folder below one that the user names."""

_LONGEST = 300


@dataclass(frozen=True, eq=False)
class FinishedRun:
    """A run that ended and has a best candidate.

    Attributes:
        folder: of the run, which is only read.
        figures: its ``result.json``.
        config: all of its configuration, resolved.
    """

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
        return self.figures.rollouts

    def best_so_far(self, length: int) -> list[float]:
        """The best reward up to and with each of ``length`` generations; a run that stopped early keeps its last."""
        best = 0.0
        so_far = []
        for index in range(length):
            if index < len(self.figures.generations):
                reward = self.figures.generations[index].best_reward
                best = max(best, reward or 0.0)

            so_far.append(best)

        return so_far

    def recordings(self) -> dict[str, Path]:
        """The recordings and the films that it left, by what they are; of several tasks each has its own."""
        found = {}
        for file in sorted(self.folder.glob("recording*.rrd")):
            if self._holds(file):
                found[file.stem] = file

        for task, film in self.films().items():
            found["film" if task == self.task else f"film {task}"] = film

        return found

    def films(self) -> dict[str, Path]:
        """The films of the best candidate, by task: of several each has its own."""
        best = self.folder / "best"
        files = {self.task: best / "rollout.gif"}
        for file in sorted(best.glob("*/rollout.gif")):
            files[file.parent.name] = file

        return {task: file for task, file in files.items() if self._holds(file)}

    def events(self) -> Iterator[tuple[str, str]]:
        """Yield the task of each look and guard of the best candidate, and what came of it, as films say it."""
        for task, film in self.films().items():
            file = film.with_name(EVENTS)
            if not self._holds(file):
                continue

            try:
                text = read_untrusted(file, MAX_BYTES).decode(errors="replace")
            except UserError:
                continue

            for line in text.splitlines()[:MAX_EVENTS]:
                yield task, short(line)

    def _holds(self, file: Path) -> bool:
        return file.is_file() and file.resolve().is_relative_to(self.folder.resolve())


@dataclass(frozen=True, eq=False)
class LeftOutRun:
    """A run that no figure counts.

    Attributes:
        folder: of the run.
        status: ``unfinished``, ``failed`` or ``unreadable``.
        reason: in words.
        task: its name; empty: not known.
        config: as far as it is known.
    """

    folder: Path
    status: Literal["unfinished", "failed", "unreadable"]
    reason: str
    task: str = ""
    config: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.status}: {short(str(self.folder))}: {self.reason}"


AnyRun = FinishedRun | LeftOutRun


def find_runs(folders: Sequence[Path]) -> tuple[list[FinishedRun], list[LeftOutRun]]:
    """Find the runs in ``folders``, each a run's own or one that holds runs, in order; those of a multirun by number.

    Raises:
        UserError: a folder is missing, or holds no run.
    """
    runs: dict[Path, AnyRun] = {}
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
    left_out = [run for run in runs.values() if isinstance(run, LeftOutRun)]

    return finished, left_out


def run_folders(folder: Path, depth: int = MAX_DEPTH) -> list[Path]:
    """Find the run folders at or below ``folder``; one with Hydra's files and nothing else is of a run that failed."""
    try:
        entries = {entry.name: entry for entry in os.scandir(folder)}
    except OSError as error:
        raise UserError(f"{folder} can't be read: {error.strerror}") from error

    if FILE in entries or RESULT in entries:
        return [folder]

    runs = []
    skipped = (HYDRA, "best", "requests", "replies")

    for name in sorted(entries, key=natural):
        below = name not in skipped and entries[name].is_dir(follow_symlinks=False)
        if below and depth > 0:
            runs += run_folders(folder / name, depth - 1)

    if not runs and HYDRA in entries:
        return [folder]

    return runs


def natural(name: str) -> list[tuple[int, int | str]]:
    """A sort key that orders numbers in names by their size."""
    return [
        (0, int(word)) if word.isdigit() else (1, word)
        for word in re.split(r"(\d+)", name)
        if word
    ]


def read_run(folder: Path) -> AnyRun:
    """Read a run from its folder."""
    store = StoredRun(folder)
    if not store.exists:
        why = f"it has no {FILE}: it ended before it began, or that was deleted"
        return LeftOutRun(folder, "failed", why)

    try:
        config = store.config()
        figures = store.result()
        false = store.find_false_claim()
    except UserError as error:
        return LeftOutRun(folder, "unreadable", short(str(error)))

    if figures is None:
        why = _progress(folder, store)
        return LeftOutRun(folder, "unfinished", why, _task(config), config)

    if figures.stopped is not None:
        why = short(f"stopped: {figures.stopped}")
        return LeftOutRun(folder, "unfinished", why, figures.task, config)

    if figures.best is None:
        why = f"no candidate could be tried{short(_first_reason(store))}"
        return LeftOutRun(folder, "failed", why, figures.task, config)

    if false:
        return LeftOutRun(folder, "unreadable", false, figures.task, config)

    return FinishedRun(folder, figures, config)


def _first_reason(store: StoredRun) -> str:
    for evaluation in store.evaluations():
        if evaluation.status != "ok":
            return f"; the first reason: {evaluation.reason}"

    return ""


def short(text: str) -> str:
    return clean(text, _LONGEST)


def _task(config: dict[str, Any]) -> str:
    """Name the task of a run without a result."""
    match config.get("task"):
        case {"file": str(file)}:
            return short(Path(file).stem)
        case {"name": str(name)}:
            return short(name)

    return ""


def is_held(folder: Path) -> bool:
    """Report whether a process is at work on the run in ``folder``."""
    file = folder / LOCK
    if file.is_symlink() or not file.is_file():
        return False

    try:
        with FileLock(file, timeout=0):
            return False
    except (Timeout, OSError):  # it is held, or nobody can tell here
        return True


def _progress(folder: Path, store: StoredRun) -> str:
    """The progress of an unfinished run, in words."""
    try:
        evaluations = store.evaluations()
    except UserError as error:
        return short(str(error))

    words = macros("plugins.results", "words")
    return str(words.progress(evaluations, is_held(folder)))


def reasons(store: StoredRun) -> list[Reason]:
    """Why candidates were rejected, failed, or earned less than their rollout did or nothing, by candidate."""
    pairs = []
    for row in store.evaluations():
        evaluation = row.unread()
        pairs.append((row.candidate, evaluation.reason or evaluation.why_nothing))

    return by_reason(pairs)

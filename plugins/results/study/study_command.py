"""``vlmgineer study NAME|FILE``: estimate a study, run what is missing of it, and report on it."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import pydantic
from omegaconf import DictConfig

from core.config.compose import load
from core.errors import UsageError, UserError, choices
from core.plugins import KINDS, installed
from core.support.cli import arguments, say
from core.support.files import write_whole, writing
from core.support.interrupts import resumable
from core.support.progress_display import busy
from plugins.results.report.report_command import report, show
from plugins.results.study.estimate import (
    Outlook,
    cores,
    look_ahead,
    reads_words,
)
from plugins.results.study.ladder import climbing
from plugins.results.study.running import Runner
from plugins.results.study.study_files import (
    RECORD,
    Method,
    Selection,
    find_study,
    name_task,
    read_settings,
    read_state,
    read_study,
)

T = TypeVar("T")

LADDER = "ladder"  # the study that has no file, since its tasks have no end
USAGE = (
    "usage: vlmgineer study NAME|FILE|ladder [budget=NAME] [tasks=NAME,NAME] [methods=NAME,NAME] [seeds=N] [jobs=N] "
    "[launch=WORDS] [folder=DIR] [yes=true] [KEY=VALUE ...]; other keys are those of core.run, such as vlm=gemini"
)
SIDE_BY_SIDE = 4  # runs that wait for a model


class StudyConfig(pydantic.BaseModel):
    """Settings of ``vlmgineer study``.

    Attributes:
        budget: one of the study's; empty: its first.
        tasks: those of its tasks that are run; empty: all.
        methods: those of its methods that are run; empty: all.
        seeds: how many; None: as many as it says.
        jobs: runs at a time; None: one, or four that wait for a language model.
        launch: words before each run's command, as of ``srun --cpus-per-task=8``.
        folder: of the results; empty: ``studies/NAME``.
        yes: start without a question.
        ask_h: ask if it takes more hours than this.
        ask_usd: ask if it takes more dollars than this, or nobody knows how many.
    """

    budget: str = ""
    tasks: list[str] = []
    methods: list[str] = []
    seeds: int | None = pydantic.Field(default=None, ge=1)
    jobs: int | None = pydantic.Field(default=None, ge=1)
    launch: str = ""
    folder: str = ""
    yes: bool = False
    ask_h: float = 0.5
    ask_usd: float = 0.0


def main(words: list[str]) -> None:
    """Estimate a study, ask, run what is missing, and report.

    Raises:
        UserError: the study or a setting can't be used, a run failed, or nobody is there to be asked.
        KeyboardInterrupt: says how to go on.
    """
    if words[:1] == [LADDER]:
        climbing.main(words[1:])
        return

    again = shlex.join(["vlmgineer", "study", *words])
    name, cfg, others = _read_words(words)
    selection = _select(cfg, find_study(name), others)
    study = selection.study
    tasks = _choose("task", cfg.tasks, {name_task(task): task for task in study.tasks})
    methods = _choose("method", cfg.methods, {m.name: m for m in study.methods})

    for method in methods:
        _check_parts(method.name, selection.settings_of(method))
    model = load("config", selection.plan(methods[:1], tasks[:1], 1)[0].words)
    waits = reads_words(model)
    if not waits:
        methods = _leave_out(methods, model)

    jobs = cfg.jobs or (SIDE_BY_SIDE if waits else 1)
    if jobs > 1 and not any(word.startswith("executor") for word in others):
        share = f"executor.workers={max(1, cores() // jobs)}"
        selection = replace(selection, words=(*others, share))

    selection.check_record(methods, tasks)
    runs = selection.plan(methods, tasks, cfg.seeds or study.seeds)
    with busy("estimating what the runs take"):
        outlook = look_ahead(runs, jobs)

    outlook.show()

    failures: list[str] = []
    if outlook.needs:
        _ask(cfg, outlook)
        record = selection.record(methods, tasks)
        with writing(selection.folder):
            selection.folder.mkdir(parents=True, exist_ok=True)
            write_whole(selection.folder / RECORD, record.encode(), shared=True)

        with resumable(f"to go on: {again}"):
            runner = Runner(list(outlook.needs), jobs, shlex.split(cfg.launch))
            failures = runner.run_all()

    begun = any(read_state(run) is not None for run in runs)
    if begun and len(failures) < len(runs):
        _report(selection.folder)
    if failures:
        raise UserError(
            f"{len(failures)} runs failed; the first, {failures[0]}; to try again: {again}"
        )


def _read_words(words: Sequence[str]) -> tuple[str, StudyConfig, list[str]]:
    """Return the study that is named, the settings of this command, and the words for the runs.

    Raises:
        UsageError: no study is named, or a setting has a wrong value.
    """
    name, rest = (words[0], words[1:]) if words else ("", words)
    if not name or "=" in name or name.startswith("-"):
        arguments(USAGE, [word for word in words if word.startswith("-")])
        raise UsageError(f"no study is named; {USAGE}")

    cfg, others = read_settings(StudyConfig, rest, USAGE, "vlmgineer study")
    return name, cfg, others


def _select(cfg: StudyConfig, file: Path, words: Sequence[str]) -> Selection:
    study = read_study(file)
    budget = cfg.budget or next(iter(study.budgets))
    if budget not in study.budgets:
        raise choices("budget", budget, study.budgets, str(file))

    folder = Path(cfg.folder or f"studies/{file.stem}")
    return Selection(study, file, folder, budget, tuple(words))


def _choose(kind: str, names: Sequence[str], known: Mapping[str, T]) -> list[T]:
    """Return what is named of what there is, in the study's order; all if nothing is named."""
    for name in names:
        if name not in known:
            raise choices(kind, name, known, "the study")

    return [known[name] for name in known if not names or name in names]


def _check_parts(method: str, words: Sequence[str]) -> None:
    """Check that the parts that a method names are installed, before anything is estimated.

    Raises:
        UsageError: one is not.
    """
    for word in words:
        kind, _, value = word.partition("=")
        if kind not in KINDS or value.startswith("{"):
            continue

        known = installed().names(kind)
        for name in value.strip("[]").split(","):
            if name.strip() and name.strip() not in known:
                unknown = choices(kind, name.strip(), known, f"method {method!r}")
                raise UsageError(
                    f"{unknown}; a part of your own is there once its package is installed: pip install -e FOLDER"
                )


def _leave_out(methods: Sequence[Method], cfg: DictConfig) -> list[Method]:
    """Leave out the methods that mean nothing to a model that reads no words, and say so."""
    left = [method for method in methods if not method.language]
    out = [method.name for method in methods if method.language]
    if out:
        say(
            f"left out: {', '.join(out)}; vlm={cfg.vlm.name} reads no words, and would design as it does anyway"
        )
    if not left:
        raise UsageError("no method is left; name a language model, such as vlm=gemini")

    return left


def _ask(cfg: StudyConfig, outlook: Outlook) -> None:
    """Ask once whether to start, if it takes more than the limits.

    Raises:
        UsageError: the answer is no, or nobody is there to be asked.
    """
    need = outlook.whole
    small = need.usd <= cfg.ask_usd and outlook.hours(need) <= cfg.ask_h
    if cfg.yes or small:
        return

    answer = ""
    if sys.stdin is not None and sys.stdin.isatty():
        say("Start? [y/N]")
        answer = sys.stdin.readline()
    if answer.strip().lower() not in ("y", "yes"):
        raise UsageError(
            "nothing was started; to start, add yes=true; tasks=, methods=, seeds= and budget= make it smaller"
        )


def _report(folder: Path) -> None:
    """Write the report of all runs in the study's folder, and print its first table.

    Raises:
        UserError: there is no run, or nothing can be written.
    """
    results = report([folder], folder / "report")
    show(results)
    say(str(folder / "report" / "index.html"))

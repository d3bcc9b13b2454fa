"""``vlmgineer study ladder vlm=NAME``: how high a method gets in each family, with an interval."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, get_args, get_type_hints

import pydantic

from core.config.compose import load
from core.errors import UsageError, choices
from core.plugins import installed
from core.support.cli import say
from core.support.files import read_text, write_whole, writing
from core.support.interrupts import resumable
from core.values.messages import sum_known
from plugins.results.pages.figure import COLORS, FigurePage, new_figure
from plugins.results.pages.formats import Table, show_table, to_csv
from plugins.results.report.statistics import interval
from plugins.results.study.ladder.staircase import (
    BUDGET,
    QUIET,
    Staircase,
    Step,
    highest,
)
from plugins.results.study.running import Runner
from plugins.results.study.study_files import AGAIN, merge, read_settings

if TYPE_CHECKING:
    from matplotlib.figure import Figure

USAGE = (
    "usage: vlmgineer study ladder [families=NAME,NAME] [seeds=N] [most=LEVEL] [jobs=N] [launch=WORDS] [folder=DIR] "
    "[name=METHOD] [KEY=VALUE ...]; other keys are those of core.run, such as vlm=gemini or budget.n_iteration=2"
)
WORDS = "method.json"
"""In the folder of a method: the words of its runs."""

MEAN = "mean"


class LadderConfig(pydantic.BaseModel):
    """Settings of ``vlmgineer study ladder``.

    Attributes:
        families: that are climbed; empty: all.
        seeds: how many.
        most: the last level that is tried.
        jobs: how many are climbed at a time.
        launch: words before each run's command.
        folder: of the results; those of several methods stand side by side.
        name: of the method; empty: the model's and the tool's.
    """

    families: list[str] = []
    seeds: int = pydantic.Field(default=3, ge=1)
    most: int = pydantic.Field(default=20, ge=1)
    jobs: int = pydantic.Field(default=1, ge=1)
    launch: str = ""
    folder: str = "studies/ladder"
    name: str = pydantic.Field(default="", pattern=r"^(\w[\w.-]*)?$", max_length=100)


def main(words: Sequence[str]) -> None:
    """Climb all families, and report.

    Raises:
        UserError: a setting can't be used, or a run did not come to its end.
        KeyboardInterrupt: says how to go on.
    """
    again = shlex.join(["vlmgineer", "study", "ladder", *words])
    command = "vlmgineer study ladder"
    cfg, others = read_settings(LadderConfig, words, USAGE, command)
    folder = Path(cfg.folder)
    known = list_families()
    for family in cfg.families:
        if family not in known:
            raise choices("family", family, known, "the ladder")

    given = tuple(merge(QUIET, BUDGET, others))
    method = cfg.name or _name(given)
    _note_words(folder / method / WORDS, given)
    stairs = [
        Staircase(family, seed, cfg.seeds, method, folder, given, cfg.most)
        for seed, family in product(range(cfg.seeds), cfg.families or known)
    ]
    runner = Runner([], cfg.jobs, shlex.split(cfg.launch))
    with resumable(f"to go on: {again}"), ThreadPoolExecutor(cfg.jobs) as pool:
        try:
            climbed = list(pool.map(lambda stair: list(stair.climb(runner)), stairs))
        except BaseException:
            runner.interrupt()
            raise

    steps = [step for climb in climbed for step in climb]
    _report(folder / method, method, steps)


def list_families() -> list[str]:
    """List the families that ``task=ladder`` has."""
    hints = get_type_hints(installed().factory("task", "ladder"))
    return list(get_args(hints["family"]))


def _name(words: Sequence[str]) -> str:
    """Name a method by its model, and by its tool where one is given."""
    config = load("config", ["protocol=ladder", "task=ladder", *words])
    given = any(word.startswith("tool=") for word in words)
    names = [str(config.vlm.name)]
    if given:
        names.append(str(config.tool.name))
    if config.budget.n_iteration:
        names.append(f"{config.budget.n_iteration + 1}rounds")

    return "_".join(names)


def _note_words(file: Path, words: Sequence[str]) -> None:
    """Note what a method's runs are made with, and refuse other words for runs that are there.

    Raises:
        UsageError: there are other words.
    """
    said = [word for word in words if not word.startswith(AGAIN)]
    if file.exists():
        before = json.loads(read_text(file, most=100_000))
        different = sorted({*before} ^ {*said})
        if different:
            raise UsageError(
                f"{file.parent} holds runs that differ in: {' '.join(different)}; name another method with name=NAME"
            )
        return

    with writing(file.parent):
        file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(file, json.dumps(said, indent=1).encode(), shared=True)


def score(steps: Iterable[Step]) -> dict[str, list[int]]:
    """Return the highest level at which a design holds, of each seed, by family."""
    climbs: dict[str, dict[int, list[Step]]] = {}
    for step in steps:
        climbs.setdefault(step.family, {}).setdefault(step.seed, []).append(step)

    return {
        family: [highest(seeds[seed]) for seed in sorted(seeds)]
        for family, seeds in sorted(climbs.items())
    }


def _group(levels: Mapping[str, Sequence[int]]) -> dict[str, list[Sequence[int]]]:
    """Return the levels that are averaged, by family, and at last those of all families."""
    groups = {name: [found] for name, found in levels.items()}
    return {**groups, MEAN: [*levels.values()]}


def tabulate(steps: Sequence[Step]) -> Table:
    """Make the table: a row for each family, and one for their mean."""
    head = "family|levels|mean:2|low:2|high:2|requests:0|tokens:0|rollouts:0|hours:2"
    rows = []
    for name, runs in _group(score(steps)).items():
        taken = [step for step in steps if name in (step.family, MEAN)]
        listed = " ".join(map(str, runs[0])) if name != MEAN else ""
        low, high = interval(runs, "mean") or (None, None)
        row = (
            name,
            listed,
            fmean(map(fmean, runs)),
            low,
            high,
            sum(step.requests for step in taken),
            sum_known(step.tokens for step in taken),
            sum(step.rollouts for step in taken),
            sum(step.seconds for step in taken) / 3600,
        )
        rows.append(row)

    return Table.of("ladder", head, rows)


def _report(folder: Path, method: str, steps: Sequence[Step]) -> None:
    """Write the table, the steps and the figure, and print the table."""
    table = tabulate(steps)
    show_table(table)
    figure = draw(method, score(steps))
    with writing(folder):
        write_whole(folder / "ladder.csv", to_csv(table, folder).encode())
        write_whole(folder / "steps.csv", to_csv(list_steps(steps), folder).encode())
        write_whole(folder / "ladder.png", figure.render("png"))
    say(str(folder / "ladder.png"))


def list_steps(steps: Sequence[Step]) -> Table:
    """Make the table of all levels that were tried."""
    head = "family|seed:0|level:0|scene seed:0|holds|unseen layouts|requests:0|tokens:0|rollouts:0|remark"
    rows = []
    for step in steps:
        shares = ", ".join(f"{name} {share:.2f}" for name, share in step.shares)
        row = (
            step.family,
            step.seed,
            step.level,
            step.drawn,
            "yes" if step.held else "no",
            shares,
            step.requests,
            step.tokens,
            step.rollouts,
            step.remark,
        )
        rows.append(row)

    return Table.of("steps", head, rows)


def draw(method: str, levels: Mapping[str, Sequence[int]]) -> FigurePage:
    """Draw the level of each seed, and their mean with its interval, by family."""

    def paint() -> Figure:
        figure = new_figure(1.6 + 1.1 * (len(levels) + 1), 3.6)
        ax = figure.subplots()
        groups = _group(levels)
        for place, (name, runs) in enumerate(groups.items()):
            color = COLORS[1 if name == MEAN else 0]
            mean = fmean(map(fmean, runs))
            ax.bar(place, mean, 0.7, color=color, alpha=0.5)
            low, high = interval(runs, "mean") or (mean, mean)
            ax.plot([place, place], [low, high], color=color, linewidth=2)
            if name != MEAN:
                ax.plot([place] * len(runs[0]), runs[0], "o", color=color, markersize=4)

        ax.set_xticks(range(len(groups)), list(groups))
        ax.set_ylabel("highest level that holds")
        ax.set_ylim(bottom=0)
        return figure

    return FigurePage("ladder", f"How high {method} climbs", paint)

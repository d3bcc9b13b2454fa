"""Courses of runs: the best reward so far against what was spent, and what it takes to reach a reward."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from core.design import count_rollouts
from core.errors import UserError
from core.geometry import Array
from core.store.database import reading
from core.store.rows import parsed
from plugins.results.pages.formats import Cell, Table, columns
from plugins.results.pages.runs import STORE, FinishedRun
from plugins.results.report.plots import Picture, band, legend, line_handles, line_style, new_figure
from plugins.results.report.results import Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ENOUGH = 0.95  # the reward that counts as reached
POINTS = 25  # of a curve, at which its interval is drawn

_QUERY = """SELECT e.content, e.status, e.reward, e.details,
    (SELECT count(*) FROM requests AS r WHERE r.generation <= e.generation) AS requests,
    (SELECT total(cost_usd) FROM replies JOIN requests AS r ON request_id = r.id
        WHERE r.generation <= e.generation) AS cost
    FROM evaluations AS e ORDER BY e.generation, e.agent, e.strategy, e.plan"""


@dataclass(frozen=True, eq=False)
class Course:
    """What a run had after each of its N candidates, by generation and number: each array (N,).

    ``cost`` is in dollars; replies of unknown cost count nothing.
    """

    best: Array
    rollouts: Array
    requests: Array
    cost: Array

    def at(self, rollouts: Array) -> Array:
        """Return the best reward after each number of ``rollouts`` (M,); 0 before the first candidate."""
        return np.concatenate([[0.0], self.best])[np.searchsorted(self.rollouts, rollouts, side="right")]

    def reached(self, reward: float) -> int | None:
        """Return the index of the first candidate that earned ``reward`` or more; None if there is none."""
        there = np.flatnonzero(self.best >= reward)
        return int(there[0]) if len(there) else None


def read_course(folder: Path) -> Course | None:
    """Read the course of a finished run; None if it has no store, or one that can't be read."""
    if not (folder / STORE).exists():
        return None
    try:
        with reading(folder) as database:
            rows = database.execute(_QUERY).fetchall()
        seen: set[str] = set()
        rollouts = []
        for row in rows:  # candidates with the same content are tried once
            rollouts.append(0 if row["content"] in seen else count_rollouts(row["status"], parsed(row["details"])))
            seen.add(row["content"])
    except (UserError, sqlite3.Error, AttributeError, KeyError, TypeError, ValueError):
        return None  # the table of runs says what is wrong with it
    best = np.maximum.accumulate(np.array([row["reward"] for row in rows], dtype=np.float64))
    requests, cost = (np.array([row[key] for row in rows], dtype=np.float64) for key in ("requests", "cost"))
    return Course(best, np.cumsum(rollouts).astype(np.float64), requests, cost)


def _courses(runs: Sequence[FinishedRun]) -> list[Course]:
    found = (read_course(run.folder) for run in runs)
    return [course for course in found if course is not None and len(course.best)]


def effort(courses: Sequence[Course]) -> tuple[int, list[float | None]]:
    """Compute the expected effort to reach `ENOUGH`, see `efforts`: runs that did; rollouts, calls, dollars."""
    ends = [course.reached(ENOUGH) for course in courses]
    reached = sum(end is not None for end in ends)
    last = [-1 if end is None else end for end in ends]
    names = ("rollouts", "requests", "cost")
    spent = [sum(float(getattr(of, name)[end]) for of, end in zip(courses, last, strict=True)) for name in names]
    return reached, [total / reached if reached else None for total in spent]


def efforts(results: Results) -> Table:
    """What it takes to reach `ENOUGH`, by task and method."""
    head = columns("task|method|runs:0|reached:0|rollouts:0|calls of the model:1|cost (USD):2")
    rows: list[tuple[Cell, ...]] = []
    for g in results.groups:
        courses = _courses(g.runs)
        reached, spent = effort(courses)
        if courses:
            rows.append((g.task, g.method, len(courses), reached, *spent))
    note = (
        f"Expected effort until a run's best reward is {ENOUGH:g}: what all runs spent until they reached it, or until "
        "their end, divided by the number of runs that did (the expected running time of N. Hansen et al., "
        "'COCO', 2021); empty where none did. A generation's calls count from its first candidate on."
    )
    return Table("efforts", f"Effort to reach {ENOUGH:g}", head, tuple(rows), note)


def anytime(results: Results, tasks: Sequence[str], methods: Sequence[str]) -> Picture | None:
    """The mean best reward so far against rollouts, over the tasks that the methods share."""
    found = {method: [_courses(g.runs) for g in results.of(method, tasks)] for method in methods}
    longest = max((course.rollouts[-1] for of in found.values() for task in of for course in task), default=0.0)
    if longest < 2 or not all(task for of in found.values() for task in of):
        return None

    def paint() -> Figure:
        figure = new_figure(6.4, 4.0)
        ax = figure.subplots()
        for method, of in found.items():
            x = np.linspace(0, max(course.rollouts[-1] for task in of for course in task), POINTS)
            scores = [np.array([course.at(x) for course in task]) for task in of]
            middle = band(ax, results, method, x, [[task[:, i].tolist() for task in scores] for i in range(POINTS)])
            ax.plot(x, middle, **line_style(results, method) | {"marker": None})
        ax.grid(axis="y", visible=True)
        ax.set_ylabel("mean best reward so far (0 to 1)")
        ax.set_xlabel("rollouts")
        legend(figure, line_handles(results, methods))
        return figure

    caption = (
        f"The best reward after each number of rollouts, averaged over runs and then over {len(tasks)} tasks; bands: "
        f"{100 * results.how.confidence:g} % stratified bootstrap intervals. A run that ended early keeps its last."
    )
    return Picture("anytime", "Reward by rollouts", caption, paint)

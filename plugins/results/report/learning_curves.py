"""Courses of runs: the best reward so far against what was spent, and what it takes to reach a reward."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from core.errors import UserError
from core.geometry import Array
from core.store.reader import StoredRun, rollouts
from plugins.results.pages.formats import Cell, Table, columns
from plugins.results.pages.runs import FinishedRun
from plugins.results.report.results import Results

ENOUGH = 0.95  # the reward that counts as reached
POINTS = 25  # of a curve, at which its interval is drawn


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


def read_course(store: StoredRun) -> Course | None:
    """Read the course of a run that ended; None if it has no candidate, or a store that can't be read."""
    try:
        evaluations, requests = store.evaluations(), store.requests()
    except UserError:
        return None  # the table of runs says what is wrong with it
    if not evaluations:
        return None
    last = np.array([e.design[0] for e in evaluations])
    asked = np.array([request.generation for request in requests])
    costs = np.array([(request.reply and request.reply.cost_usd) or 0.0 for request in requests])
    until = np.arange(last[-1] + 1)[:, None] >= asked  # (generations, requests)
    return Course(
        np.maximum.accumulate([e.reward for e in evaluations]),
        np.cumsum(rollouts(evaluations)).astype(np.float64),
        until.sum(axis=1).astype(np.float64)[last],
        (until * costs).sum(axis=1)[last],
    )


def read_courses(runs: Sequence[FinishedRun]) -> list[Course]:
    """Read the courses of runs, as far as they have one."""
    return [course for run in runs if (course := read_course(run.store)) is not None]


def efforts(results: Results) -> Table:
    """What it takes to reach `ENOUGH`, by task and method."""
    head = columns("task|method|runs:0|reached:0|rollouts:0|calls of the model:1|cost (USD):2")
    rows: list[tuple[Cell, ...]] = []
    for g in results.groups:
        courses = read_courses(g.runs)
        ends = [course.reached(ENOUGH) for course in courses]
        reached = sum(end is not None for end in ends)
        last = [(course, -1 if end is None else end) for course, end in zip(courses, ends, strict=True)]
        spent = [
            sum(float(getattr(course, of)[end]) for course, end in last) for of in ("rollouts", "requests", "cost")
        ]
        if courses:
            rows.append((g.task, g.method, len(courses), reached, *(x / reached if reached else None for x in spent)))
    note = (
        f"Expected effort until a run's best reward is {ENOUGH:g}: what all runs spent until they reached it, or until "
        "their end, divided by the number of runs that did (the expected running time of N. Hansen et al., "
        "'COCO', 2021); empty where none did. A generation's calls count from its first candidate on."
    )
    return Table("efforts", f"Effort to reach {ENOUGH:g}", head, tuple(rows), note)

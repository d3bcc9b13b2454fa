"""The runs of a report, grouped by task and method. Covered by `tests/plugins/results/report/test_methods.py`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from plugins.results.pages.runs import FinishedRun, LeftOutRun
from plugins.results.report.leaderboard import Entry
from plugins.results.report.methods import Group, group
from plugins.results.report.statistics import Resampling


@dataclass(frozen=True, eq=False)
class Results:
    """Finished runs, which are counted; runs that are left out; how bootstrap intervals are drawn; entries."""

    runs: tuple[FinishedRun, ...]
    left_out: tuple[LeftOutRun, ...] = ()
    how: Resampling = field(default_factory=Resampling)
    entries: tuple[Entry, ...] = ()

    @cached_property
    def groups(self) -> list[Group]:
        return group(self.runs, self.left_out)

    @property
    def tasks(self) -> list[str]:
        return list(dict.fromkeys(g.task for g in self.groups))

    @cached_property
    def methods(self) -> list[str]:
        """The methods, in the order in which they appear among the runs."""
        method_of = {run: g.method for g in self.groups for run in g.runs}
        return list(dict.fromkeys(method_of[run] for run in self.runs))

    def of(self, method: str, tasks: Sequence[str] | None = None) -> list[Group]:
        """The groups of a method, on ``tasks`` or on all its tasks."""
        return [g for g in self.groups if g.method == method and (tasks is None or g.task in tasks)]

    def get(self, task: str, method: str) -> Group | None:
        return next((g for g in self.groups if g.task == task and g.method == method), None)

    def shared(self, *methods: str) -> list[str]:
        """The tasks that all of these methods have runs of."""
        return [task for task in self.tasks if all(self.get(task, method) for method in methods)]

"""The runs of a report, grouped by task and method, and their best tools."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from core.designs.tool_fields import MAX_DESCRIPTION
from core.errors import UserError
from core.support.text import clean
from plugins.results.pages.best_tool import Winner, best_tool
from plugins.results.pages.runs import FinishedRun, LeftOutRun
from plugins.results.report.entries import ListedEntry
from plugins.results.report.methods import Group, group
from plugins.results.report.verify import VerifiedRun
from plugins.results.study.study_files import Study


class BestTools(NamedTuple):
    """The best tool of each task and method, and which tools can't be shown, and why."""

    best: dict[tuple[str, str], Winner]
    problems: list[str]


@dataclass(frozen=True, eq=False)
class Results:
    """What a report is about.

    Attributes:
        runs: finished runs, which are counted.
        left_out: runs that are not.
        entries: of a benchmark.
        verified: the runs of an entry whose designs were tried again.
        study: that the runs belong to; None: none is known.
    """

    runs: tuple[FinishedRun, ...]
    left_out: tuple[LeftOutRun, ...] = ()
    entries: tuple[ListedEntry, ...] = ()
    verified: tuple[VerifiedRun, ...] = ()
    study: Study | None = None

    @cached_property
    def groups(self) -> list[Group]:
        """The runs by task and method, the methods in the order of the study."""
        found = group(self.runs, self.left_out)
        return sorted(found, key=lambda g: (g.task, self._rank(g.method)))

    def _rank(self, method: str) -> int:
        """The place of a method in the study; those that it does not name come last."""
        planned = [m.name for m in self.study.methods] if self.study else []
        return planned.index(method) if method in planned else len(planned)

    @property
    def tasks(self) -> list[str]:
        return list(dict.fromkeys(g.task for g in self.groups))

    @cached_property
    def methods(self) -> list[str]:
        """The methods, in the order of the study, or in which they appear among the runs."""
        method_of: dict[FinishedRun, str] = {}
        for g in self.groups:
            method_of |= dict.fromkeys(g.runs, g.method)

        found = dict.fromkeys(method_of[run] for run in self.runs)
        return sorted(found, key=self._rank)

    def groups_of(self, method: str) -> list[Group]:
        """The groups of a method."""
        return [g for g in self.groups if g.method == method]

    @cached_property
    def tools(self) -> BestTools:
        """The tools of the best runs, but for the bare hand."""
        tools = BestTools({}, [])
        for g in self.groups:
            try:
                winner = best_tool(g.best)
            except UserError as error:
                problem = clean(str(error), MAX_DESCRIPTION)
                tools.problems.append(f"{g.task}, {g.method}: {problem}")
                continue

            if winner.tool.components:
                tools.best[g.task, g.method] = winner

        return tools

"""Ask plugins whether tools can be made, and prefer those that can."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from core.design import DesignError, Tool
from core.events import Run
from core.plugins import installed
from core.plugins.blame import judge_design
from core.trial import Condition, Evaluation, Making

_KIND = "maker"


class Judge:
    """Says of designs whether their tools can be made, by what plugins offer (`core.hooks.Configs.makers`).

    Attributes:
        decides: whether it counts in the choice of a winner: not by the paper's convention, of which nothing is made.

    Args:
        run: whose material and printer count.
        conditions: in which the search tried designs.
    """

    def __init__(self, run: Run, conditions: Sequence[Condition]) -> None:
        self.decides = run.representation.material.density_kg_m3 is not None
        self._run = run
        self._conditions = {condition.where: condition for condition in conditions}
        self._known: dict[str, Making | None] = {}

    def judge(self, evaluation: Evaluation) -> Making | None:
        """Say whether the tool of a design that was tried can be made; None: there is nothing to make."""
        content = evaluation.candidate.content
        if content not in self._known:
            self._known[content] = self._ask(evaluation)

        return self._known[content]

    def _ask(self, evaluation: Evaluation) -> Making | None:
        shown = evaluation.shown
        if shown is None or shown.where not in self._conditions:
            return None

        condition = self._conditions[shown.where]
        plugins = installed()
        for name, maker in plugins.factories(_KIND).items():
            owner = plugins.offers[_KIND, name].owner
            try:
                making = judge_design(owner, maker, self._run, condition, evaluation)
            except DesignError as error:
                making = Making(None, str(error))
            if isinstance(making, Making):
                return making

        return None

    def find_first(self, evaluations: Iterable[Evaluation]) -> Evaluation | None:
        """Find the first whose tool can be made; None: none of those that are looked at can.

        Of many tools the first three are looked at, the fifth, the ninth and so on: the neighbours of a tool that can't
        be made are often like it.
        """
        by_tool: dict[Tool | None, Evaluation] = {}
        for evaluation in evaluations:
            by_tool.setdefault(evaluation.candidate.tool, evaluation)

        firsts = list(by_tool.values())
        number = 0
        while number < len(firsts):
            making = self.judge(firsts[number])
            if making is not None and making.possible:
                return firsts[number]
            number = max(number + 1, 2 * number)

        return None

"""Evaluate candidates in several layouts of the task, and in several engines if asked."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from core.config.compose import engines
from core.design import Candidate, Evaluation
from core.errors import UsageError, choices
from core.interfaces import Simulator, Task
from core.plugins import PluginPart
from core.simulation.rollout import Evaluator
from core.support.templates import fill
from core.values.layouts import NONE, Ranges
from plugins.fitness.robustness import CheckedEvaluator, mean
from plugins.fitness.several import SeveralTrials

MARGIN_SHARE = 0.1  # of a reward, with ``combine=margin``
UNSEEN = 1_000_000  # the first seed of the layouts that no search sees; the same ones for all runs
_MOST_SEED = UNSEEN - 1_000  # of a run, whose designer may look at some layouts more


def worst_quarter(rewards: Sequence[float]) -> float:
    """Compute the mean of the lowest quarter of rewards, of at least one."""
    return float(np.mean(sorted(rewards)[: math.ceil(len(rewards) / 4)]))


@dataclass(frozen=True)
class _Weighed(CheckedEvaluator):
    """Give a tenth of each reward for the least margin: all of it where that is far from the limit."""

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        return [self._weighed(evaluation) for evaluation in super().__call__(candidates)]

    @staticmethod
    def _weighed(evaluation: Evaluation) -> Evaluation:
        if (least := evaluation.least_margin) is None:
            return evaluation
        return replace(evaluation, reward=evaluation.reward * (1 - MARGIN_SHARE * (1 - max(least.margin, 0.0))))


COMBINE: dict[str, tuple[Callable[[Sequence[float]], float], str]] = {
    "mean": (mean, "the mean of its rewards"),
    "margin": (mean, f"the mean of its rewards, of each of which a share of {MARGIN_SHARE:g} is for the least margin"),
    "worst": (min, "its lowest reward"),
    "worst_quarter": (worst_quarter, "the mean of the lowest quarter of its rewards"),
}
"""What becomes of a plan's rewards over the layouts, and that in words."""


class Layouts(SeveralTrials):
    """The rewards over layouts, combined, in the engine where that is the lowest.

    Args:
        evaluator: the task, how plans are executed, and the first layout's seed; the others' seeds follow it.
        layouts: how many there are; each costs a rollout in each engine.
        combine: ``mean``, ``worst`` or ``worst_quarter`` of the rewards; ``margin``: the mean, of which a share is for
            the least margin.
        sims: see `core.config.compose.engines`; none: the run's engine.
        final: how many more layouts of the run's own seeds decide, in each engine of ``unseen_sims``, between
            candidates that earn alike; 0: the shortest distance decides.
        unseen: how many other layouts the best candidate is tried in at the end.
        unseen_sims: the engines for those, with their own settings; none: the engines of the search.

    Raises:
        UserError: a setting or an engine that can't be used, or a task whose layouts are all the same.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        layouts: int = 5,
        combine: str = "mean",
        sims: list[str | dict[str, Any]] = [],  # noqa: B006 - read as a configuration's default
        final: int = 8,
        unseen: int = 20,
        unseen_sims: list[str | dict[str, Any]] = [],  # noqa: B006
    ) -> None:
        for name, count, least in (("layouts", layouts, 1), ("final", final, 0), ("unseen", unseen, 0)):
            if count < least:
                raise UsageError(f"fitness.{name} must be at least {least}, got {count}")
        if evaluator.seed + layouts + final > _MOST_SEED:
            what = "seed, fitness.layouts and fitness.final together"
            raise UsageError(f"{what} must be at most {_MOST_SEED}; those after are unseen")
        if combine not in COMBINE:
            raise choices("way to combine rewards", combine, COMBINE, "fitness.combine")
        task = evaluator.task.create()
        if _alike(task, evaluator.seed):
            others = " or ".join(f"task.variation={name}" for name in task.variations)
            mend = f"add {others}" if others else "the task has no variations"
            raise UsageError(f"fitness=layouts: all layouts of {task.name} are the same; {mend}")
        self._evaluator, self._final, self._unseen = evaluator, final, unseen
        self._sims = engines(sims, evaluator.sim) if sims else {evaluator.sim.name: evaluator.sim}
        self._unseen_sims = engines(unseen_sims) if unseen_sims else self._sims
        self._seeds = range(evaluator.seed, evaluator.seed + layouts)
        how, self._counts = COMBINE[combine]
        kind = _Weighed if combine == "margin" else CheckedEvaluator
        super().__init__(self._in_layouts(self._seeds, self._sims, kind), how, "layout")

    def _in_layouts(
        self,
        seeds: Sequence[int],
        sims: Mapping[str, PluginPart[Simulator]],
        kind: type[CheckedEvaluator] = CheckedEvaluator,
    ) -> dict[str, list[Evaluator]]:
        base = self._evaluator
        return {name: [kind(base.task, sim, seed, base.settings) for seed in seeds] for name, sim in sims.items()}

    def instructions(self) -> str:
        return fill(
            "plugins.fitness",
            "layouts",
            layouts=len(self._seeds),
            sims=[*self._sims],
            elsewhere=[] if self._unseen_sims is self._sims else [*self._unseen_sims],
            drawn=describe_ranges(self._evaluator.task.create().ranges),
            noise=self._evaluator.settings.perception,
            counts=self._counts,
            final=self._final,
            unseen=self._unseen,
        )

    def final(self) -> dict[str, list[Evaluator]]:
        seeds = range(self._seeds.stop, self._seeds.stop + self._final)
        return self._in_layouts(seeds, self._unseen_sims) if self._final else {}

    def unseen(self) -> dict[str, list[Evaluator]]:
        seeds = range(UNSEEN, UNSEEN + self._unseen)
        return self._in_layouts(seeds, self._unseen_sims) if self._unseen else {}


def _alike(task: Task, seed: int) -> bool:
    """Report whether two seeds give the same layout."""
    if task.variation != NONE:
        return False
    one, other = (task.scene(of).bodies for of in (seed, seed + 1))
    return len(one) == len(other) and all(
        a.pose == b.pose and a.mass == b.mass for a, b in zip(one, other, strict=True)
    )


def describe_ranges(ranges: Ranges) -> str:
    """List the ranges in words, for a model: metres, radians, kilograms."""
    groups: dict[tuple[str, str], list[str]] = {}  # card_1.x, card_2.x, ... in one, if they share a range
    for name, (low, high) in ranges.items():
        groups.setdefault((re.sub(r"\d+", "", name), f"from {low:.4g} to {high:.4g}"), []).append(name)
    return ", ".join(
        f"{names[0]}{f' to {names[-1]}' if len(names) > 1 else ''} {span}" for (_, span), names in groups.items()
    )

"""Evaluate candidates in several layouts of the task, and in several engines if asked."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

from pydantic import NonNegativeInt, PositiveInt

from core.config.compose import engines
from core.design import Candidate
from core.errors import UsageError, choices
from core.hooks import Harmless, PartsOf
from core.interfaces import Condition, Fitness, Score, Simulator, Task, Trial
from core.support.templates import fill
from core.trial import Part
from core.values.layouts import NONE
from plugins.fitness.perturbation_range import PerturbationRange
from plugins.fitness.robustness import Perturbation
from plugins.fitness.several import Combine, mean, score_by_worst_engine, worst_quarter

# Of tool and bodies, beside what a layout draws; it says where bodies are.
WEAR = PerturbationRange(position=0.0, yaw=0.0, size=0.01)
UNSEEN = 1_000_000  # the first seed of the layouts that no search sees; the same ones for all runs
_SAME_M = 1e-6  # two places that are nearer are one
_MOST_SEED = UNSEEN - 1_000  # of a run, whose designer and finalists see some more


COMBINE: dict[str, tuple[Combine, str]] = {
    "mean": (mean, "the mean of its rewards"),
    "worst": (min, "its lowest reward"),
    "worst_quarter": (worst_quarter, "the mean of the lowest quarter of its rewards"),
}
"""What becomes of a plan's rewards over the layouts, and that in words."""


class Layouts(Fitness):
    """The rewards over layouts, combined, in the engine where that is the lowest.

    Args:
        condition: the task, how plans are executed, and the first layout; the others' seeds follow it.
        layouts: how many there are; each costs a rollout in each engine.
        combine: ``mean``, ``worst`` or ``worst_quarter`` of the rewards.
        sims: see `core.config.compose.engines`; none: the run's engine.
        unseen: how many other layouts the best candidate is tried in at the end; of few benches at most half of those
            that the search leaves.
        unseen_sims: the engines for those, with their own settings; none: the engines of the search.

    Raises:
        UserError: a setting or an engine that can't be used, or a task whose layouts are all the same.
    """

    def __init__(
        self,
        condition: Condition,
        layouts: PositiveInt = 5,
        combine: Harmless[str] = "mean",
        sims: Annotated[list[str | dict[str, Any]], PartsOf("sim")] = [],  # noqa: B006 - read as a configuration's default
        unseen: NonNegativeInt = 20,
        unseen_sims: Annotated[list[str | dict[str, Any]], PartsOf("sim")] = [],  # noqa: B006
    ) -> None:
        if condition.layout + layouts > _MOST_SEED:
            raise UsageError(
                f"seed and fitness.layouts together must be at most {_MOST_SEED}; those after are unseen"
            )

        if combine not in COMBINE:
            raise choices("way to combine rewards", combine, COMBINE, "fitness.combine")

        task = condition.task.shared()
        if _are_alike(task, condition.layout):
            others = " or ".join(f"task.variation={name}" for name in task.variations)
            mend = f"add {others}" if others else "the task has no variations"
            raise UsageError(
                f"fitness=layouts: all layouts of {task.name} are the same; {mend}"
            )

        self._condition = condition
        self._sims: Mapping[str, Part[Simulator]] = {condition.sim.name: condition.sim}
        if sims:
            self._sims = engines(sims, condition.sim)

        self._unseen_sims = engines(unseen_sims) if unseen_sims else self._sims
        self._seeds = range(condition.layout, condition.layout + layouts)
        self._choose_seeds(unseen)
        self._combine, self._counts = COMBINE[combine]
        self.races = combine == "mean"

    def conditions(self) -> list[Condition]:
        return self._in_layouts(self._seeds, self._sims)

    def score(self, candidate: Candidate, trials: Sequence[Trial]) -> Score:
        return score_by_worst_engine(trials, self._combine, "layout")

    def _in_layouts(
        self, seeds: Sequence[int], sims: Mapping[str, Part[Simulator]]
    ) -> list[Condition]:
        return [
            replace(self._condition, sim=sim, layout=seed, engine=name)
            for name, sim in sims.items()
            for seed in seeds
        ]

    def instructions(self) -> str:
        task = self._condition.task.shared()
        return fill(
            "plugins.fitness",
            "layouts",
            layouts=len(self._seeds),
            sims=[*self._sims],
            other_sims=[] if self._unseen_sims is self._sims else [*self._unseen_sims],
            drawn=describe_ranges(task),
            noise=task.perceive(self._condition.settings.perception),
            counts=self._counts,
            unseen=len(self._unseen),
        )

    def finals(self) -> Iterator[list[Condition]]:
        """Yield the layouts after the search's, in the engines of the unseen ones."""
        for seed in self._finals:
            yield self._in_layouts([seed], self._unseen_sims)

    def perturbed(self, conditions: Sequence[Condition]) -> list[Condition]:
        return [
            replace(condition, change=Perturbation(WEAR, condition.layout))
            for condition in conditions
        ]

    def unseen(self) -> list[Condition]:
        return self._in_layouts(self._unseen, self._unseen_sims)

    def _choose_seeds(self, unseen: int) -> None:
        """Choose the seeds of further layouts, and of as many unseen ones as are asked for.

        Where a layout takes one of few benches (`core.values.layouts.Sets`), none is tried twice: what the search
        leaves is for the choice of the winner, and at most half of it unseen.
        """
        last = self._seeds.stop
        count = self._condition.task.shared().draw(0).count
        self._finals: Sequence[int] = range(last, UNSEEN)
        self._unseen: Sequence[int] = range(UNSEEN, UNSEEN + unseen)
        if not count:
            return

        left = range(last, max(last, self._seeds.start + count))
        kept = min(unseen, len(left) // 2)
        first = len(left) - kept
        self._finals = left[:first]
        self._unseen = [UNSEEN + (seed - UNSEEN) % count for seed in left[first:]]


def _are_alike(task: Task, seed: int) -> bool:
    """Report whether two seeds give the same layout."""
    if task.variation != NONE:
        return False

    first = [(body.pose, body.mass) for body in task.scene(seed).bodies]
    second = [(body.pose, body.mass) for body in task.scene(seed + 1).bodies]
    return first == second


def describe_ranges(task: Task) -> str:
    """List the ranges of a task in words, for a model: metres, radians, kilograms.

    A range is ``relative`` if what is drawn is not the place of a body's origin in the world.
    """
    draw = task.draw(0)
    relative = {
        f"{body.name}.{axis}"
        for body in task.scene(0).bodies
        for axis, place in zip("xyz", body.pose.position, strict=True)
        if abs(draw(f"{body.name}.{axis}", place) - place) > _SAME_M
    }

    # Numbers such as card_1.x, card_2.x, ... are one group, if they share a range.
    groups: dict[tuple[str, str], list[str]] = {}
    for name, (low, high) in task.ranges.items():
        span = (
            f"from {low:.4g} to {high:.4g}{' (relative)' if name in relative else ''}"
        )
        plain = re.sub(r"\d+", "", name)
        groups.setdefault((plain, span), []).append(name)

    described: list[str] = []
    for (_, span), names in groups.items():
        others = f" to {names[-1]}" if len(names) > 1 else ""
        described.append(f"{names[0]}{others} {span}")

    return ", ".join(described)

"""Score candidates by perturbed scenes and several engines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

from pydantic import Field, NonNegativeInt

from core.config.compose import engines
from core.design import Candidate
from core.hooks import PartsOf
from core.interfaces import Condition, Fitness, Score, Trial
from core.support.templates import fill
from plugins.fitness.perturbation_range import PerturbationRange
from plugins.fitness.robustness import Perturbation
from plugins.fitness.several import score_by_worst_engine

ENGINES: list[str | dict[str, Any]] = ["pybullet", "sapien"]


class Robust(Fitness):
    """The lowest, over the engines ``sims``, of the mean rewards over perturbed scenes.

    Args:
        condition: the task, its layout, how plans are executed, and the settings of its engine if ``sims`` names it.
        sims: see `core.config.compose.engines`.
        seeds: of the perturbations; each costs a rollout in each engine.
        perturbation: the ranges of the perturbations.

    Raises:
        UserError: an engine that can't be used.
    """

    def __init__(
        self,
        condition: Condition,
        sims: Annotated[list[str | dict[str, Any]], PartsOf("sim")] = ENGINES,
        seeds: Annotated[list[NonNegativeInt], Field(min_length=1)] = [0, 1, 2],  # noqa: B006
        perturbation: PerturbationRange = PerturbationRange(),  # noqa: B008
    ) -> None:
        self._condition = condition
        self._sims = engines(sims, condition.sim)
        self._changes = [Perturbation(perturbation, seed) for seed in seeds]
        self._ranges = perturbation

    def conditions(self) -> list[Condition]:
        return [
            replace(self._condition, sim=sim, engine=name, change=change)
            for name, sim in self._sims.items()
            for change in self._changes
        ]

    def score(self, candidate: Candidate, trials: Sequence[Trial]) -> Score:
        return score_by_worst_engine(trials)

    def instructions(self) -> str:
        given = {
            "draws": len(self._changes),
            "sims": [*self._sims],
            "most": self._ranges,
        }
        return fill("plugins.fitness", "robust", **given)

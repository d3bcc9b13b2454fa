"""Evaluate candidates in perturbed scenes and several engines."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from core.config.compose import engines
from core.simulation.rollout import Evaluator
from core.support.templates import fill
from plugins.fitness.robustness import PerturbationRange, check_draws, mean, perturbed
from plugins.fitness.several import SeveralTrials


class Robust(SeveralTrials):
    """The lowest, over the engines ``sims``, of the mean rewards over perturbed scenes.

    Args:
        evaluator: the task, its layout, how plans are executed, and the settings of its engine if ``sims`` names it.
        sims: see `core.config.compose.engines`.
        seeds: of the perturbations; each costs a rollout in each engine.
        perturbation: the ranges of the perturbations.

    Raises:
        UserError: an engine or a seed that can't be used.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        sims: list[str | dict[str, Any]] = ["pybullet", "sapien"],  # noqa: B006 - read as a configuration's default
        seeds: list[int] = [0, 1, 2],  # noqa: B006
        perturbation: PerturbationRange = PerturbationRange(),  # noqa: B008
    ) -> None:
        check_draws(seeds)
        evaluators = {
            name: [perturbed(replace(evaluator, sim=sim), perturbation, seed) for seed in seeds]
            for name, sim in engines(sims, evaluator.sim).items()
        }
        super().__init__(evaluators, mean, "change")
        self._draws, self._perturbation = len(seeds), perturbation

    def instructions(self) -> str:
        given = {"draws": self._draws, "sims": [*self.evaluators], "most": self._perturbation}
        return fill("plugins.fitness", "robust", **given)

"""Evaluate candidates in perturbed scenes and several engines."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from core.config.compose import engines
from core.simulation.rollout import Evaluator
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
        one, most = len(self.evaluators) == 1, self._perturbation
        times = f"{self._draws} times" if self._draws > 1 else "once"
        where = f"{'the engine' if one else 'each of the engines'} {', '.join(self.evaluators)}"
        counts = "the mean of its rewards" if one else "the lowest of the engines' mean rewards"
        return (
            f"A plan is tried with its tool {times} in {where}, each time in a scene that differs a little, "
            "at random, from the one described here: bodies that can move "
            f"are moved by up to {most.position:g} m along x and along y and turned by up to {most.yaw:g} rad about z, "
            f"masses differ by up to {most.mass:.0%}, friction by up to {most.friction:.0%}. "
            f"What counts is {counts}; a trial that fails counts 0. So leave margins."
        )

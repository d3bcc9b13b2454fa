"""What a candidate earns on its own merits: the reward of one rollout (``nominal``), or what the worst of several
engines gives it on average when the scene changes a little (``robust``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
from omegaconf import OmegaConf

from core.config.compose import load, part
from core.config.settings import PerturbationRange
from core.design import Candidate, DesignError, Evaluation
from core.designs.rules import SpawnRules
from core.errors import UsageError, choices
from core.interfaces import Task
from core.plugins import Part, check_settings
from core.simulation.perturbation import Perturbed
from core.simulation.rollout import Evaluator

Fitness = Callable[[Sequence[Candidate]], list[Evaluation]]
"""Picklable: called in workers, with candidates of one tool; or with any, as many as its ``batch`` if it has one and it
is greater than 1.
"""


@dataclass(frozen=True)
class PerturbedPart(Part):
    """A task whose scene is changed a little."""

    spread: PerturbationRange = field(default_factory=PerturbationRange)
    draw: int = 0

    def create(self, **given: Any) -> Task:
        return Perturbed(super().create(**given), self.spread, self.draw)


@dataclass(frozen=True)
class PerturbedEvaluator(Evaluator):
    """A bench with a changed scene. A tool that starts clear of the scene as the task has it, but not of this one, is
    rejected.
    """

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        rules = _spawn_rules(self.task, self.seed)
        return super().__call__([_checked(candidate, rules) for candidate in candidates])


@lru_cache(maxsize=256)
def _spawn_rules(task: Part, seed: int) -> SpawnRules:
    return SpawnRules(task.create(), seed)


def _checked(candidate: Candidate, rules: SpawnRules) -> Candidate:
    if candidate.tool is None or candidate.problem is not None:
        return candidate
    try:
        rules.check(candidate.tool)
    except DesignError as error:
        return replace(candidate, problem=f"with the scene a little changed, {error}")
    return candidate


def perturbed(bench: Evaluator, spread: PerturbationRange, draw: int) -> Evaluator:
    """The bench with its scene changed by lot ``draw``."""
    task = PerturbedPart(bench.task.kind, bench.task.name, bench.task.settings, spread, draw)
    return PerturbedEvaluator(task, bench.sim, bench.seed, bench.settings)


def engines(sims: Sequence[str | Mapping[str, Any]], chosen: Part | None = None) -> dict[str, Part]:
    """Engines, each under the name that people are shown.

    An entry is a name as in ``sim=NAME``, or a mapping of a ``name`` and the settings that differ from the
    configuration's. Where ``chosen`` is named, its settings are what the configuration says.

    Raises:
        UserError: there is no such engine, or it lacks something; no entries at all, or one twice.
    """
    found: dict[str, Part] = {}
    for entry in sims:
        settings = {"name": entry} if isinstance(entry, str) else {str(key): value for key, value in entry.items()}
        name = settings.pop("name", None)
        if not isinstance(name, str):
            raise UsageError(f"sims: {entry!r} names no engine; give a name, or {{name: NAME, SETTING: VALUE}}")
        shown = " ".join([name, *(f"{key}={value}" for key, value in settings.items())])
        if shown in found:
            raise UsageError(f"sims: {shown!r} stands there twice")
        if chosen is not None and chosen.name == name:
            usual = dict(chosen.settings)
        else:
            usual = dict(part("sim", load("evaluate", [f"sim={name}"]).sim).settings)
        found[shown] = part("sim", OmegaConf.create({"name": name, **usual, **settings}))
        found[shown].create()  # what is wrong with it is said here, once, rather than by each worker
    if not found:
        raise UsageError("sims: name at least one engine")
    return found


def check_draws(seeds: Sequence[int]) -> None:
    """Refuse seeds of changes that can't be.

    Raises:
        UsageError: none at all, a negative one, or one twice.
    """
    if not seeds or min(seeds) < 0 or len(set(seeds)) < len(seeds):
        raise UsageError(f"seeds must be one or more different numbers, 0 or greater; got {list(seeds)}")


# --- the choices ------------------------------------------------------------------------------------------------


def nominal(bench: Evaluator) -> Fitness:
    """The reward in the engine that ``sim`` names, with the scene as the task has it."""
    return bench


def robust(
    bench: Evaluator,
    sims: list[str | dict[str, Any]] = ["pybullet", "sapien"],  # noqa: B006 - read as a configuration's default
    seeds: list[int] = [0, 1, 2],  # noqa: B006
    spread: PerturbationRange = PerturbationRange(),  # noqa: B008
) -> Fitness:
    """The mean reward over small changes of the scene in that engine of ``sims`` where it is the lowest.

    Args:
        bench: the task, its layout and how plans are executed; its engine's settings hold where ``sims`` names it.
        sims: see `engines`.
        seeds: of the changes, a rollout for each in each engine.
        spread: how far they go at most.
    """
    check_draws(seeds)
    return Robust(
        tuple(
            (shown, tuple(perturbed(replace(bench, sim=sim), spread, draw) for draw in seeds))
            for shown, sim in engines(sims, bench.sim).items()
        )
    )


FITNESS: dict[str, Callable[..., Fitness]] = {"nominal": nominal, "robust": robust}


def fitness(config: Mapping[str, Any], bench: Evaluator) -> Fitness:
    """The fitness that a configuration node names; whatever else it holds are its settings.

    Raises:
        UserError: there is none of that name, or a setting is wrong.
    """
    settings = {str(key): value for key, value in config.items()}
    name = str(settings.pop("name", None))
    if name not in FITNESS:
        raise choices("fitness", name, FITNESS)
    given = {"bench": bench}
    return FITNESS[name](**check_settings(FITNESS[name], settings, f"fitness={name}", given), **given)


# --- robust -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Robust:
    """Tries candidates on several benches per engine; an evaluation's reward is the worst engine's mean."""

    benches: tuple[tuple[str, tuple[Evaluator, ...]], ...]

    @property
    def batch(self) -> int:
        """Candidates that all of its engines like at once."""
        return min(bench.batch for _, benches in self.benches for bench in benches)

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        tried = {engine: [bench(candidates) for bench in benches] for engine, benches in self.benches}
        return [
            worst(candidate, {engine: [each[i] for each in evaluations] for engine, evaluations in tried.items()})
            for i, candidate in enumerate(candidates)
        ]


def worst(candidate: Candidate, tried: Mapping[str, Sequence[Evaluation]]) -> Evaluation:
    """One evaluation of a candidate from those that it was given in each engine.

    Its reward is the lowest of the engines' means, in which a trial that was rejected or failed counts 0, and
    ``details["engines"]`` has each engine's mean, standard deviation and rewards. The rest is that of a trial that
    went well, in the worst engine if there is one; if none went well, of the first. What went wrong is a warning.
    """
    figures = {engine: statistics(evaluations) for engine, evaluations in tried.items()}
    lowest = min(figures, key=lambda engine: figures[engine]["mean"])
    every = [*tried[lowest], *(e for engine, evaluations in tried.items() if engine != lowest for e in evaluations)]
    shown = next((e for e in every if e.status == "ok"), every[0])
    warnings = [*shown.warnings]
    if shown.status == "ok":
        for engine, evaluations in tried.items():
            for i, e in enumerate(evaluations, start=1):
                if e.status != "ok":
                    warnings.append(f"{engine}, change {i} of {len(evaluations)}: {e.status}: {e.reason}")
    return replace(
        shown,
        candidate=candidate,
        reward=figures[lowest]["mean"],
        warnings=tuple(warnings),
        details={"engines": figures},
    )


def statistics(evaluations: Sequence[Evaluation]) -> dict[str, Any]:
    """Mean and standard deviation of rewards, and the rewards."""
    rewards = [float(e.reward) for e in evaluations]
    return {"mean": float(np.mean(rewards)), "std": float(np.std(rewards)), "rewards": rewards}

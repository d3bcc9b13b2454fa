"""Evaluate candidates in several engines and in perturbed scenes, and combine the results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from core.config.compose import listed, part
from core.config.settings import PerturbationRange
from core.design import Candidate, DesignError, Evaluation, Tool, Trial
from core.designs.rules import SpawnRules
from core.errors import UsageError
from core.interfaces import Simulator, Task
from core.plugins import SIMULATOR, PluginPart
from core.simulation.perturbation import Perturbed
from core.simulation.rollout import Evaluator


@dataclass(frozen=True)
class PerturbedPart(PluginPart[Task]):
    """A task with a perturbed scene."""

    perturbation: PerturbationRange = field(default_factory=PerturbationRange)
    draw: int = 0

    def create(self, **given: Any) -> Task:
        return Perturbed(super().create(**given), self.perturbation, self.draw)


@dataclass(frozen=True)
class CheckedEvaluator(Evaluator):
    """Evaluate in a scene other than the run's. A tool that overlaps it at spawn is rejected."""

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        tools = {id(candidate.tool): candidate.tool for candidate in candidates}  # most candidates share one
        problems = {number: self._problem(tool) for number, tool in tools.items()}
        return super().__call__([replace(c, problem=c.problem or problems[id(c.tool)]) for c in candidates])

    def _problem(self, tool: Tool | None) -> str | None:
        if tool is None:
            return None
        try:
            _spawn_rules(self.task, self.seed).check(tool)
        except DesignError as error:
            return f"{self._where}, {error}"
        return None

    @property
    def _where(self) -> str:
        return "in the perturbed scene" if isinstance(self.task, PerturbedPart) else f"in layout {self.seed}"

    @property
    def change(self) -> int | None:
        return self.task.draw if isinstance(self.task, PerturbedPart) else None


@lru_cache(maxsize=256)
def _spawn_rules(task: PluginPart[Task], seed: int) -> SpawnRules:
    return SpawnRules(task.create(), seed)


def perturbed(evaluator: Evaluator, perturbation: PerturbationRange, draw: int) -> Evaluator:
    """Perturb an evaluator's scene by draw number ``draw``."""
    of = evaluator.task
    task = PerturbedPart(of.kind, of.name, of.settings, of.robot, perturbation=perturbation, draw=draw)
    return CheckedEvaluator(task, evaluator.sim, evaluator.seed, evaluator.settings)


def engines(
    sims: Sequence[str | Mapping[str, Any]], chosen: PluginPart | None = None
) -> dict[str, PluginPart[Simulator]]:
    """Make the engines, by the names under which they are shown.

    An entry is a name as in ``sim=NAME``, or a mapping of a ``name`` and settings that differ from the
    configuration's. For the engine of ``chosen`` these are the configuration's settings.

    Raises:
        UserError: an engine does not exist or can't be used here; there are no entries, or one is repeated.
    """
    nodes = listed("sim", "engine", sims, chosen)
    found: dict[str, PluginPart[Simulator]] = {shown: part(SIMULATOR, node) for shown, node in nodes.items()}
    for engine in found.values():
        engine.create()  # so that a fault is reported once, not by each worker
    return found


def check_draws(seeds: Sequence[int]) -> None:
    """Check the draw numbers of perturbations.

    Raises:
        UsageError: there are none, one is negative, or one is repeated.
    """
    if not seeds or min(seeds) < 0 or len(set(seeds)) < len(seeds):
        raise UsageError(f"seeds must be one or more different numbers, 0 or greater; got {list(seeds)}")


def mean(rewards: Sequence[float]) -> float:
    """Compute the mean."""
    return float(np.mean(rewards))


def worst(
    candidate: Candidate,
    tried: Mapping[str, Sequence[Evaluation]],
    combine: Callable[[Sequence[float]], float] = mean,
    trial: str = "change",
) -> Evaluation:
    """Combine a candidate's evaluations in each engine into one, by the worst engine.

    The reward is the lowest of the engines' combined rewards; a rejected or failed trial counts 0. The distance is the
    mean of the trials that succeeded. All else is taken from the one of these with the lowest reward, of equal ones
    from that with the least margin, in the worst engine if there is one there; if none succeeded, from the first. It
    alone keeps its observation. Failures become warnings; ``trial`` is what they call a trial.
    """
    rewards = {engine: combine([e.reward for e in evaluations]) for engine, evaluations in tried.items()}
    lowest = min(rewards, key=lambda engine: rewards[engine])
    others = [e for engine, evaluations in tried.items() if engine != lowest for e in evaluations]
    succeeded = [[e for e in trials if e.status == "ok"] for trials in (tried[lowest], others)]
    shown = min(succeeded[0] or succeeded[1] or tried[lowest][:1], key=_worst_first)
    failures = [
        f"{engine}, {trial} {i} of {len(evaluations)}: {e.status}: {e.reason}"
        for engine, evaluations in tried.items()
        for i, e in enumerate(evaluations, start=1)
        if e.status != "ok" and shown.status == "ok"
    ]
    made = [
        replace(_trial(evaluation), engine=engine, observation=evaluation.observation if evaluation is shown else None)
        for engine, evaluations in tried.items()
        for evaluation in evaluations
    ]
    return replace(
        shown,
        candidate=candidate,
        reward=rewards[lowest],
        distance_m=mean([e.distance_m for e in (*succeeded[0], *succeeded[1])] or [shown.distance_m]),
        warnings=(*shown.warnings, *failures),
        trials=tuple(made),
        combined=True,
    )


def _worst_first(evaluation: Evaluation) -> tuple[float, float]:
    least = evaluation.least_margin
    return evaluation.reward, np.inf if least is None else least.margin


def _trial(evaluation: Evaluation) -> Trial:
    """Return the trial of an evaluation; one that says nothing of it, as a stranger's evaluator may, gets one."""
    known = evaluation.trials[0] if evaluation.trials else Trial()
    return replace(known, status=evaluation.status, reward=float(evaluation.reward), reason=evaluation.reason)

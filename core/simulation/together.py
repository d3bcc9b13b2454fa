"""Evaluate candidates that have a plan for each of several tasks, and combine what they earn."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from omegaconf import DictConfig

from core.config.compose import part, task_part, task_parts
from core.design import Candidate, Evaluation, Trial
from core.interfaces import Evaluate, Fitness, RolloutSettings, Task
from core.plugins import FITNESS, SIMULATOR
from core.simulation.rollout import Evaluator
from core.values.plans import TaskPlans

COMBINE: dict[str, Callable[[Sequence[float]], float]] = {"mean": statistics.fmean, "worst": min}


class Together(Fitness):
    """Evaluate each candidate in several tasks, by name, and combine the rewards: their ``mean``, or the ``worst``."""

    def __init__(self, each: Mapping[str, Evaluate], combine: str) -> None:
        self._each, self._combine = each, combine

    @property
    def batch(self) -> int:
        return min(evaluate.batch for evaluate in self._each.values())

    def prepare(self) -> None:
        for evaluate in self._each.values():
            evaluate.prepare()

    def __call__(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        tried = {task: evaluate([c.of(task) for c in candidates]) for task, evaluate in self._each.items()}
        return [
            self._combined(candidate, {task: own[number] for task, own in tried.items()})
            for number, candidate in enumerate(candidates)
        ]

    def instructions(self) -> str:
        counts = "mean of its rewards" if self._combine == "mean" else "lowest of its rewards"
        return (
            f"A tool is tried in each of the tasks with a plan of its own. What counts is the {counts} over the tasks."
        )

    def instructions_of(self, task: str) -> str:
        """Return what plans for one task are judged by (`Fitness.instructions`)."""
        each = self._each[task]
        return each.instructions() if isinstance(each, Fitness) else ""

    def final(self) -> dict[str, list[Together]]:
        return self._trials([each.final() for each in self._each.values() if isinstance(each, Fitness)])

    def unseen(self) -> dict[str, list[Together]]:
        return self._trials([each.unseen() for each in self._each.values() if isinstance(each, Fitness)])

    def _trials(self, found: Sequence[Mapping[str, Sequence[Evaluate]]]) -> dict[str, list[Together]]:
        """Join the trials of the tasks that have the same engine and number."""
        return {
            engine: [
                Together(dict(zip(self._each, trial, strict=True)), self._combine)
                for trial in zip(*(own[engine] for own in found), strict=True)
            ]
            for engine in found[0]
        }

    def _combined(self, candidate: Candidate, tried: Mapping[str, Evaluation]) -> Evaluation:
        """Combine the evaluations in each task; other numbers are those of the task with the lowest reward."""
        ok = [e for e in tried.values() if e.status == "ok"]
        shown = min(ok or list(tried.values()), key=lambda e: e.reward)
        said = [f"{task}: {w}" for task, e in tried.items() for w in (*([e.reason] if e.reason else []), *e.warnings)]
        return replace(
            shown,
            candidate=candidate,
            reward=COMBINE[self._combine]([e.reward if e.status == "ok" else 0.0 for e in tried.values()]),
            distance_m=statistics.fmean(e.distance_m for e in ok) if ok else math.nan,
            warnings=tuple(said),
            trials=tuple(replace(t, task=task) for task, e in tried.items() for t in e.trials or [_untried(e)]),
            combined=True,
            figures={task: e.reward if e.status == "ok" else 0.0 for task, e in tried.items()},
        )

    def joined(self, evaluations: Iterable[Evaluation], key: tuple[int, int, int, int]) -> Evaluation | None:
        """Join the best plan for each task of candidates with one tool; it needs no rollout. None: there is one such.

        ``key`` is that of the candidate to make (`Candidate.key`).
        """
        known = [e for e in evaluations if e.status == "ok"]
        best = {task: max(known, key=lambda e: e.figures.get(task, 0.0)) for task in self._each} if known else {}
        plans = TaskPlans(tuple((task, e.candidate.plan.of(task)) for task, e in best.items()))
        if not known or any(e.candidate.plan.content == plans.content for e in known):
            return None
        generation, agent, strategy, action = key
        first = max(known, key=lambda e: e.reward).candidate
        named = replace(first, generation=generation, agent=agent, strategy=strategy, action=action, plan=plans)
        made = self._combined(named, {task: of_task(e, task) for task, e in best.items()})
        tried_as = {task: e.candidate.id for task, e in best.items()}
        trials = (replace(trial, tried_as=trial.tried_as or tried_as[trial.task]) for trial in made.trials)
        return replace(made, trials=tuple(trials))


def _untried(evaluation: Evaluation) -> Trial:
    return Trial(status=evaluation.status, reason=evaluation.reason)


def of_task(evaluation: Evaluation, task: str) -> Evaluation:
    """Return what a candidate earned in one of its tasks, as the evaluation of a candidate with that plan alone."""
    if task not in evaluation.figures:
        return replace(evaluation, candidate=evaluation.candidate.of(task))
    trials = tuple(replace(trial, task="") for trial in evaluation.trials if trial.task == task)
    said = (warning.partition(": ") for warning in evaluation.warnings)
    return replace(
        evaluation,
        candidate=evaluation.candidate.of(task),
        status=min((trial.status for trial in trials), key=("ok", "failed", "rejected").index, default="rejected"),
        reward=evaluation.figures[task],
        distance_m=math.nan,
        reason=next((trial.reason for trial in trials if trial.reason), ""),
        warnings=tuple(rest for name, _, rest in said if name == task),
        trials=trials,
        combined=len(trials) > 1,
        figures={},
    )


def weakest(task: Task, evaluation: Evaluation) -> tuple[Task, Evaluation]:
    """Return the task in which a candidate with several earned least, and its evaluation there."""
    part = min(task.parts, key=lambda part: evaluation.figures.get(part.name, 0.0))
    return part, of_task(evaluation, part.name)


def make_fitness(config: DictConfig, settings: RolloutSettings) -> Fitness:
    """Make the fitness that a configuration names, for its task or for all parts of it.

    Raises:
        UserError: a part or setting that can't be used.
    """
    sim, each = part(SIMULATOR, config.sim), dict[str, Fitness]()
    for one in task_parts(config):
        evaluator = Evaluator(one, sim, config.seed, settings)
        each[one.create().name] = part(FITNESS, config.fitness).create(evaluator=evaluator)
    if len(each) == 1:
        return next(iter(each.values()))
    return Together(each, task_part(config).create().combine)

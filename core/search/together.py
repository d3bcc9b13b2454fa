"""Score candidates that have a plan for each of several tasks, and join the best plans for one tool."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from omegaconf import DictConfig

from core.config.compose import part, task_part, task_parts
from core.design import Candidate
from core.interfaces import Fitness, RolloutSettings, Task
from core.plugins import FITNESS, SIMULATOR
from core.trial import Condition, Evaluation, Score, Trial
from core.values.plans import TaskPlans, digest

COMBINE: dict[str, Callable[[Sequence[float]], float]] = {
    "mean": statistics.fmean,
    "worst": min,
}


class Together(Fitness):
    """Score each candidate in several tasks, and combine the rewards: their ``mean``, or the ``worst``.

    Args:
        each: the fitness in each task, by the task's name.
        combine: a key of `COMBINE`.
    """

    def __init__(self, each: Mapping[str, Fitness], combine: str) -> None:
        self._each = each
        self._combine = combine

    def conditions(self) -> list[Condition]:
        return [
            condition
            for fitness in self._each.values()
            for condition in fitness.conditions()
        ]

    def score(self, candidate: Candidate, trials: Sequence[Trial]) -> Score:
        """Combine the scores in each task; the trial that is shown is that of the task with the lowest reward."""
        scores: dict[str, Score] = {}
        numbers: dict[str, list[int]] = {}
        for task, fitness in self._each.items():
            numbers[task] = [
                number for number, trial in enumerate(trials) if trial.task == task
            ]
            scores[task] = fitness.score(
                candidate, [trials[number] for number in numbers[task]]
            )

        shown_in = {task: numbers[task][score.shown] for task, score in scores.items()}
        done = [
            task for task, number in shown_in.items() if trials[number].status == "ok"
        ]
        lowest = min(done or list(scores), key=lambda task: scores[task].reward)
        warnings = [
            line
            for task in scores
            for line in _said(task, trials[shown_in[task]], scores[task])
        ]
        figures = {task: score.reward for task, score in scores.items()}
        return Score(
            self._combined(figures), figures, shown_in[lowest], tuple(warnings)
        )

    def finals(self) -> Iterator[list[Condition]]:
        for alike in zip(
            *(fitness.finals() for fitness in self._each.values()), strict=False
        ):
            yield [condition for conditions in alike for condition in conditions]

    def unseen(self) -> list[Condition]:
        return [
            condition
            for fitness in self._each.values()
            for condition in fitness.unseen()
        ]

    def rewards(self, trials: Sequence[Trial]) -> dict[str, tuple[float, ...]]:
        """Return the combined rewards in each engine: a number for each layout."""
        by_task = [
            fitness.rewards([trial for trial in trials if trial.task == task])
            for task, fitness in self._each.items()
        ]
        found = {}
        for engine in by_task[0]:
            alike = zip(*(rewards[engine] for rewards in by_task), strict=True)
            found[engine] = tuple(COMBINE[self._combine](rewards) for rewards in alike)
        return found

    def instructions(self) -> str:
        reward = "mean" if self._combine == "mean" else "lowest"
        return (
            "A tool is tried in each of the tasks with a plan of its own. "
            f"What counts is the {reward} of its rewards over the tasks."
        )

    def instructions_in(self, task: str) -> str:
        return self._each[task].instructions()

    def joined(self, tried: Sequence[Evaluation]) -> Iterator[Candidate]:
        """Yield for each tool of the last generation the best of all its plans for the tasks, if that is new."""
        tools: dict[str, list[Evaluation]] = {}
        for evaluation in sorted(tried, key=lambda e: e.candidate.key):
            if evaluation.status == "ok" and evaluation.candidate.tool is not None:
                tools.setdefault(digest(evaluation.candidate.tool.content), []).append(
                    evaluation
                )
        last = max((e.candidate.generation for e in tried), default=0)
        for own in tools.values():
            now = [e.candidate.key for e in own if e.candidate.generation == last]
            if now:
                first = now[0][:3]
                action = 1 + max(
                    e.candidate.action for e in tried if e.candidate.key[:3] == first
                )
                yield from self._join(own, (*first, action))

    def _join(
        self, known: Sequence[Evaluation], key: tuple[int, int, int, int]
    ) -> Iterator[Candidate]:
        """Join the best plan for each task of candidates with one tool, under the key of a new candidate."""
        plans = []
        for task in self._each:
            best = max(known, key=lambda e: e.figures.get(task, 0.0))
            plans.append((task, best.candidate.plan.of(task)))
        joined = TaskPlans(tuple(plans))
        if any(e.candidate.plan.content == joined.content for e in known):
            return

        generation, agent, strategy, action = key
        first = max(known, key=lambda e: e.reward).candidate
        yield replace(
            first,
            generation=generation,
            agent=agent,
            strategy=strategy,
            action=action,
            plan=joined,
        )

    def _combined(self, figures: Mapping[str, float]) -> float:
        return COMBINE[self._combine](list(figures.values()))


def _said(task: str, trial: Trial, score: Score) -> Iterator[str]:
    """Say what is to be said of a candidate in one of the tasks, beside what its trial says itself if it is shown."""
    reasons = [trial.reason] if trial.reason else []
    for line in (*reasons, *trial.warnings, *score.warnings):
        yield f"{task}: {line}"


def weakest(task: Task, evaluation: Evaluation) -> tuple[Task, Evaluation]:
    """Return the task in which a candidate with several earned least, and its evaluation there."""
    part = min(task.parts, key=lambda part: evaluation.figures.get(part.name, 0.0))
    return part, evaluation.in_task(part.name)


def make_fitness(config: DictConfig, settings: RolloutSettings) -> Fitness:
    """Make the fitness that a configuration names, for its task or for all parts of it.

    Raises:
        UserError: a part or setting that can't be used.
    """
    sim = part(SIMULATOR, config.sim)
    each: dict[str, Fitness] = {}
    for task in task_parts(config):
        condition = Condition(task, sim, config.seed, settings)
        each[task.shared().name] = part(FITNESS, config.fitness).create(
            condition=condition
        )
    if len(each) == 1:
        return next(iter(each.values()))
    return Together(each, task_part(config).create().combine)

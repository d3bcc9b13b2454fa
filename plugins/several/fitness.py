"""Score candidates that have a plan for each of several tasks, and join the best plans for one tool."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from core.design import Candidate
from core.interfaces import ActionPlan, Condition, Evaluation, Fitness, Score, Trial
from core.values.plans import digest
from plugins.several.plans import TaskPlans

COMBINE: dict[str, Callable[[Sequence[float]], float]] = {
    "mean": statistics.fmean,
    "worst": min,
}


class Together(Fitness):
    """Score each candidate in several tasks, and combine the rewards: their ``mean``, or the ``worst``.

    Args:
        by_task: the fitness in each task, by the task's name.
        combine: a key of `COMBINE`.
    """

    def __init__(self, by_task: Mapping[str, Fitness], combine: str) -> None:
        self.by_task = by_task
        self._combine = combine

    def conditions(self) -> list[Condition]:
        found: list[Condition] = []
        for fitness in self.by_task.values():
            found += fitness.conditions()
        return found

    def score(self, candidate: Candidate, trials: Sequence[Trial]) -> Score:
        """Combine the scores in each task; the trial that is shown is that of the task with the lowest reward."""
        scores: dict[str, Score] = {}
        shown: dict[str, int] = {}
        for task, fitness in self.by_task.items():
            numbers = [n for n, trial in enumerate(trials) if trial.task == task]
            score = fitness.score(candidate, [trials[number] for number in numbers])
            scores[task] = score
            shown[task] = numbers[score.shown]

        played = [task for task in scores if trials[shown[task]].status == "ok"]
        lowest = min(played or list(scores), key=lambda task: scores[task].reward)
        warnings: list[str] = []
        for task, score in scores.items():
            warnings += _describe(task, trials[shown[task]], score)
        figures = {task: score.reward for task, score in scores.items()}
        reward = COMBINE[self._combine](list(figures.values()))
        return Score(reward, figures, shown[lowest], tuple(warnings))

    def finals(self) -> Iterator[list[Condition]]:
        endless = [fitness.finals() for fitness in self.by_task.values()]
        for alike in zip(*endless, strict=False):
            yield [condition for conditions in alike for condition in conditions]

    def unseen(self) -> list[Condition]:
        found: list[Condition] = []
        for fitness in self.by_task.values():
            found += fitness.unseen()
        return found

    def rewards(self, trials: Sequence[Trial]) -> dict[str, tuple[float, ...]]:
        """Return the combined rewards in each engine: a number for each layout."""
        by_task = [
            fitness.rewards([trial for trial in trials if trial.task == task])
            for task, fitness in self.by_task.items()
        ]
        found: dict[str, tuple[float, ...]] = {}
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

    def recombine(self, tried: Sequence[Evaluation]) -> Iterator[Candidate]:
        """Yield for each tool of the last generation the best of all its plans for the tasks, if that is new."""
        ordered = sorted(tried, key=lambda evaluation: evaluation.candidate.key)
        last = max((e.candidate.generation for e in ordered), default=0)
        for known in _group_by_tool(ordered).values():
            recent = [e.candidate for e in known if e.candidate.generation == last]
            plans = self._best_plans(known)
            if not recent or any(
                e.candidate.plan.content == plans.content for e in known
            ):
                continue

            strategy = recent[0].key[:3]
            siblings = [e.candidate for e in tried if e.candidate.key[:3] == strategy]
            best = max(known, key=lambda evaluation: evaluation.reward)
            yield replace(
                best.candidate,
                generation=recent[0].generation,
                agent=recent[0].agent,
                strategy=recent[0].strategy,
                action=1 + max(sibling.action for sibling in siblings),
                plan=plans,
            )

    def _best_plans(self, known: Sequence[Evaluation]) -> TaskPlans:
        """Join the best plan for each task of candidates with one tool."""
        plans: list[tuple[str, ActionPlan | str]] = []
        for task in self.by_task:
            rewards = [evaluation.figures.get(task, 0.0) for evaluation in known]
            best = known[rewards.index(max(rewards))]
            plans.append((task, best.candidate.plan.of(task)))
        return TaskPlans(tuple(plans))


def _group_by_tool(
    evaluations: Iterable[Evaluation],
) -> dict[str, list[Evaluation]]:
    """Group the candidates that were tried by what their tools are."""
    groups: dict[str, list[Evaluation]] = {}
    for evaluation in evaluations:
        tool = evaluation.candidate.tool
        if evaluation.status == "ok" and tool is not None:
            groups.setdefault(digest(tool.content), []).append(evaluation)
    return groups


def _describe(task: str, trial: Trial, score: Score) -> Iterator[str]:
    """Say what is to be said of a candidate in one of the tasks, beside what its trial says itself if it is shown."""
    reasons = [trial.reason] if trial.reason else []
    for line in (*reasons, *trial.warnings, *score.warnings):
        yield f"{task}: {line}"

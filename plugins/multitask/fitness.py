"""Score candidates that have a plan for each of several tasks, and join the best plans for one tool."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain

from core.design import Candidate
from core.interfaces import ActionPlan, Condition, Evaluation, Fitness, Score, Trial
from core.values.contents import digest
from plugins.multitask.joined_plans import TaskPlans

# What counts of a candidate's rewards in the tasks, by the name in the configuration.
COMBINE: dict[str, Callable[[Sequence[float]], float]] = {
    "mean": statistics.fmean,
    "worst": min,
}


class Together(Fitness):
    """Score each candidate in several tasks, and combine the rewards: their ``mean``, or the ``worst``.

        fitness = Together({"BringCube": nominal, "OneBook": robust}, "mean")
        score = fitness.score(candidate, trials)

    A candidate has a plan for each task. What it earned in each is among the figures of its score, by the task's name.

    Args:
        by_task: the fitness in each task, by the task's name.
        combine: a key of `COMBINE`.
    """

    def __init__(self, by_task: Mapping[str, Fitness], combine: str) -> None:
        self.by_task = by_task
        self.finals_check = any(judge.finals_check for judge in by_task.values())
        self.tie_by = next(iter(by_task.values())).tie_by
        self._combine = combine

    def conditions(self) -> list[Condition]:
        """Return the conditions of all tasks, one task after the other."""
        return list(chain(*[judge.conditions() for judge in self.by_task.values()]))

    def score(self, candidate: Candidate, trials: Sequence[Trial]) -> Score:
        """Combine the scores in each task; the trial that is shown is that of the task with the lowest reward.

        Args:
            candidate: with a plan for each task.
            trials: of all tasks, in the order of the conditions.
        """
        scores: dict[str, Score] = {}

        shown: dict[str, int] = {}  # the number of the trial that stands for a task

        for task, fitness in self.by_task.items():
            numbers = [n for n, trial in enumerate(trials) if trial.task == task]
            score = fitness.score(candidate, [trials[number] for number in numbers])
            scores[task] = score
            shown[task] = numbers[score.shown]

        # A task in which it was played says more than one in which it was refused.
        played = [task for task in scores if trials[shown[task]].status == "ok"]
        lowest = min(played or list(scores), key=lambda task: scores[task].reward)

        warnings: list[str] = []
        for task, score in scores.items():
            warnings += _describe(task, trials[shown[task]], score)

        figures = {task: score.reward for task, score in scores.items()}
        reward = COMBINE[self._combine](list(figures.values()))

        return Score(reward, figures, shown[lowest], tuple(warnings))

    def finals(self) -> Iterator[list[Condition]]:
        """Yield the next conditions of each task together, until one has no more."""
        further = [judge.finals() for judge in self.by_task.values()]
        for alike in zip(*further, strict=False):
            yield list(chain(*alike))

    def perturbed(self, conditions: Sequence[Condition]) -> list[Condition]:
        """Return the conditions of each task, perturbed as its own fitness does."""
        perturbed: list[Condition] = []
        for name, judge in self.by_task.items():
            own_layout = [c for c in conditions if c.where.task == name]
            perturbed += judge.perturbed(own_layout)

        return perturbed

    def unseen(self) -> list[Condition]:
        """Return the unseen conditions of all tasks."""
        return list(chain(*[judge.unseen() for judge in self.by_task.values()]))

    def rewards(self, trials: Sequence[Trial]) -> dict[str, tuple[float, ...]]:
        """Return the combined rewards in each engine: a number for each layout.

        Args:
            trials: of one candidate, in all tasks.

        Returns:
            By engine. A task's layouts are numbered alike in all of them.
        """
        by_engine: dict[str, list[tuple[float, ...]]] = {}
        for task, judge in self.by_task.items():
            in_task = [trial for trial in trials if trial.task == task]
            for engine, rewards in judge.rewards(in_task).items():
                by_engine.setdefault(engine, []).append(rewards)

        combine = COMBINE[self._combine]

        return {
            engine: tuple(map(combine, zip(*rewards, strict=True)))
            for engine, rewards in by_engine.items()
        }

    def instructions(self) -> str:
        reward = "mean" if self._combine == "mean" else "lowest"
        return (
            "A tool is tried in each of the tasks with a plan of its own. "
            f"What counts is the {reward} of its rewards over the tasks."
        )

    def recombine(self, tried: Sequence[Evaluation]) -> Iterator[Candidate]:
        """Yield for each tool of the last generation the best of all its plans for the tasks, if that is new.

        Args:
            tried: all candidates of the run so far, in any order.
        Returns:
            With a number of a plan that none of the tool's candidates has.
        """
        ordered = sorted(tried, key=lambda evaluation: evaluation.candidate.key)
        last = max((e.candidate.generation for e in ordered), default=0)

        for known in _group_by_tool(ordered).values():
            recent = [e.candidate for e in known if e.candidate.generation == last]
            plans = self._best_plans(known)

            if not recent or any(
                e.candidate.plan.content == plans.content for e in known
            ):
                continue

            design = recent[0].key[:3]
            siblings = [e.candidate for e in tried if e.candidate.key[:3] == design]

            best = max(known, key=lambda evaluation: evaluation.reward)
            yield replace(
                best.candidate,
                generation=recent[0].generation,
                agent=recent[0].agent,
                design=recent[0].design,
                action=1 + max(sibling.action for sibling in siblings),
                plan=plans,
            )

    def _best_plans(self, known: Sequence[Evaluation]) -> TaskPlans:
        """Join the best plan for each task of candidates with one tool.

        Args:
            known: evaluations of candidates with the same tool.
        Returns:
            A plan for each task, or the reason why there is none.
        """
        plans: list[tuple[str, ActionPlan | str]] = []
        for task in self.by_task:
            rewards = [evaluation.figures.get(task, 0.0) for evaluation in known]
            best = known[rewards.index(max(rewards))]
            plans.append((task, best.candidate.plan.of(task)))

        return TaskPlans(tuple(plans))


def _group_by_tool(
    evaluations: Iterable[Evaluation],
) -> dict[str, list[Evaluation]]:
    """Group the candidates that were tried by what their tools are.

    Args:
        evaluations: in any order; those that were not played have no group.

    Returns:
        By a digest of the tool, the evaluations in their order.
    """
    groups: dict[str, list[Evaluation]] = {}
    for evaluation in evaluations:
        tool = evaluation.candidate.tool
        if evaluation.status == "ok" and tool is not None:
            groups.setdefault(digest(tool.content), []).append(evaluation)

    return groups


def _describe(
    task: str,
    trial: Trial,
    score: Score,
) -> Iterator[str]:
    """Say what is to be said of a candidate in one of the tasks, beside what its trial says itself if it is shown.

    Args:
        task: the name of the task.
        trial: the one that is shown there.
        score: what the fitness made of the trials there.
    Returns:
        A line for each thing to say, which begins with the task.
    """
    for line in (trial.reason, *trial.warnings, *trial.objections, *score.warnings):
        if line:
            yield f"{task}: {line}"

"""Play candidates with tasks and engines that are there already, as a run plays them with parts by name."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from core.design import Candidate
from core.interfaces import (
    Condition,
    Executor,
    Fitness,
    RolloutSettings,
    Score,
    Simulator,
    Task,
    Trial,
)
from core.search.trials import Trials
from core.simulation.play import play
from core.trial import Evaluation
from plugins.fitness.nominal import Nominal


@dataclass(frozen=True, eq=False)
class Made:
    """A part that is made already."""

    made: Any
    name: str = "made"
    settings: tuple[tuple[str, Any], ...] = field(default=())

    def shared(self) -> Any:
        return self.made

    def declared(self, name: str, default: Any) -> Any:
        return getattr(self.made, name, default)


@dataclass(frozen=True)
class Named:
    """A task or an engine of which only the name is asked."""

    name: str = "anything"
    settings: tuple[tuple[str, Any], ...] = ()
    batch: int = 1

    def shared(self) -> Named:
        return self

    def declared(self, name: str, default: Any) -> Any:
        return getattr(self, name, default)


@dataclass(frozen=True)
class Scripted:
    """Stands for `core.simulation.play.play`: ``evaluate`` says what candidates earn, in any condition."""

    evaluate: Callable[[list[Candidate]], list[Evaluation]]

    def __call__(
        self, condition: Condition, candidates: Sequence[Candidate]
    ) -> list[Trial]:
        return [
            replace(e.trials[0], where=condition.where)
            for e in self.evaluate(list(candidates))
        ]


def scripted(
    evaluate: Callable[[list[Candidate]], list[Evaluation]],
    executor: Executor,
    **settings: Any,
) -> tuple[Trials, Fitness]:
    """Make trials in which candidates earn what ``evaluate`` says, and the fitness of one condition."""
    sim = Named(batch=getattr(evaluate, "batch", 1))
    return Trials(executor, play=Scripted(evaluate), **settings), Nominal(
        Condition(Named(), sim)
    )


def condition(
    task: Task,
    simulator: Simulator,
    seed: int = 0,
    settings: RolloutSettings | None = None,
) -> Condition:
    return Condition(Made(task), Made(simulator), seed, settings or RolloutSettings())


def evaluate_batch(
    task: Task,
    simulator: Simulator,
    candidates: Sequence[Candidate],
    seed: int = 0,
    settings: RolloutSettings | None = None,
) -> list[Evaluation]:
    """Try candidates in one layout; the evaluation of each has one trial."""
    trials = play(condition(task, simulator, seed, settings), candidates)
    return [
        Evaluation(candidate, (trial,), Score(trial.reward))
        for candidate, trial in zip(candidates, trials, strict=True)
    ]


def evaluate_all(
    candidates: Iterable[Candidate], where: Condition, executor: Executor
) -> Iterator[Evaluation]:
    """Try candidates in one condition, in an executor's workers."""
    return Trials(executor).evaluate(candidates, Nominal(where))

"""Define what events carry: the run, its generations, its result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any

from core.interfaces import Budget, RolloutSettings, Simulator, Task, ToolRepresentation
from core.trial import TIE, Evaluation, Making, Rewards, Tally, Trial, best_first
from core.values.efforts import Effort, Held

INTERRUPTED = "interrupted"


@dataclass(frozen=True, eq=False)
class Run:
    """A run, as listeners receive it. ``parts`` are the chosen names by kind; ``config`` is the resolved configuration.

    ``simulator`` is the main process's own, and idle while a listener works. With it and ``settings`` a listener can
    play a candidate again.
    """

    folder: Path
    config: dict[str, Any]
    parts: dict[str, str]
    model: str
    task: Task
    representation: ToolRepresentation
    budget: Budget
    seed: int
    simulator: Simulator | None = None
    settings: RolloutSettings = field(default_factory=RolloutSettings)


@dataclass(frozen=True, eq=False)
class Generation:
    """One generation: its number, 0 for the first, and its evaluations in the order of `Candidate.key`.

    ``tie`` is the difference between rewards that counts as none (`core.trial.best_first`).
    """

    index: int
    evaluations: tuple[Evaluation, ...]
    tie: float = TIE

    @cached_property
    def ranking(self) -> list[Evaluation]:
        """The candidates that were tried, the best first."""
        return best_first(self.evaluations, self.tie)

    @property
    def best(self) -> Evaluation | None:
        """The best candidate; None: none could be tried.

        It may earn up to ``tie`` less than `best_reward`, or still less where trials in more layouts spoke for it.
        """
        return next(iter(self.ranking), None)

    @cached_property
    def best_reward(self) -> float | None:
        """The highest reward; None if no candidate could be tried."""
        return max((e.reward for e in self.ranking), default=None)

    @property
    def mean_reward(self) -> float | None:
        """The mean over the candidates that were tried; None if there are none."""
        rewards = [e.reward for e in self.evaluations if e.status == "ok"]
        if not rewards:
            return None
        return sum(rewards) / len(rewards)

    def count(self, status: str) -> int:
        """Count the evaluations with this status."""
        return sum(e.status == status for e in self.evaluations)


@dataclass(frozen=True, eq=False)
class Result:
    """The result of a run: its generations, and how long it took.

    ``stopped`` says what cut the run short, a limit that was reached or `INTERRUPTED`; then the last generation may
    lack candidates. None: it came to its end. ``tie`` is as in `Generation`. ``unseen`` are, by engine, the rewards of
    the best candidate in ``unseen_trials``, which the search never saw, if the fitness has any. ``winner`` was chosen
    of those that earn alike by more trials, in which finalists earned ``finals``, by their id and engine; ``held`` says
    in how many layouts more the winner held, and ``perturbed`` what came of it with tool and bodies perturbed.
    ``effort`` is the best's in the unseen trials, and ``second_engine`` its trial in a second engine, if there is one.
    ``making`` says whether the best's tool can be made; where it can't, ``makeable`` is the best whose tool can, as far
    as was looked.
    """

    generations: tuple[Generation, ...]
    wall_time_s: float
    stopped: str | None = None
    tie: float = TIE
    unseen: Rewards = field(default_factory=dict)
    unseen_trials: tuple[Trial, ...] = ()
    winner: Evaluation | None = None
    finals: Mapping[str, Rewards] = field(default_factory=dict)
    held: Held = field(default_factory=Held)
    perturbed: Tally = field(default_factory=Tally)
    effort: Effort | None = None
    second_engine: Trial | None = None
    making: Making | None = None
    makeable: Evaluation | None = None

    @cached_property
    def evaluations(self) -> tuple[Evaluation, ...]:
        """Those of all generations, in order."""
        groups = [generation.evaluations for generation in self.generations]
        return tuple(chain(*groups))

    @cached_property
    def ranking(self) -> list[Evaluation]:
        """The candidates of all generations that were tried, the best first."""
        return best_first(self.evaluations, self.tie)

    @property
    def best(self) -> Evaluation | None:
        """The best candidate of all generations; None if none could be tried."""
        return self.winner or next(iter(self.ranking), None)

    @property
    def n_evaluations(self) -> int:
        """The number of candidates that were not rejected. Some may share an evaluation."""
        return sum(e.status != "rejected" for e in self.evaluations)

    @property
    def rollouts(self) -> int:
        """How many rollouts there were; equal candidates share theirs."""
        # Nobody shares perturbed trials, and those that were rejected were not played.
        perturbed = self.perturbed.in_order()
        played = sum(trial.status != "rejected" for trial in perturbed)
        return played + sum(e.rollouts for e in self.evaluations)

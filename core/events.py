"""What events carry: what a run is, its generations, and what it came to."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from core.design import Evaluation, best_first
from core.interfaces import Budget, RolloutSettings, Simulator, Task, ToolRepresentation

INTERRUPTED = "interrupted"


@dataclass(frozen=True, eq=False)
class Run:
    """What listeners are told of a run. ``parts`` are the names chosen, by kind; ``config`` is all of it, resolved.

    ``simulator`` is the main process's own, idle while listeners are told something: with ``settings`` a listener can
    play a candidate again, to see what it does.
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
    """One round: its number, 0 for the first sampling, and its evaluations in the order of `Candidate.key`."""

    index: int
    evaluations: tuple[Evaluation, ...]

    @cached_property
    def best(self) -> Evaluation | None:
        """None if nothing could be tried."""
        return next(iter(best_first(self.evaluations)), None)

    @property
    def mean_reward(self) -> float | None:
        """Over the candidates that were tried; None if there are none."""
        rewards = [e.reward for e in self.evaluations if e.status == "ok"]
        return sum(rewards) / len(rewards) if rewards else None

    def count(self, status: str) -> int:
        return sum(e.status == status for e in self.evaluations)


@dataclass(frozen=True, eq=False)
class Result:
    """What a run came to. ``best`` is of all generations; None if nothing could be tried.

    ``stopped`` says what cut the run short, a limit that was reached or `INTERRUPTED`; then the last generation may
    lack candidates. None: it came to its end.
    """

    generations: tuple[Generation, ...]
    wall_time_s: float
    stopped: str | None = None

    @cached_property
    def best(self) -> Evaluation | None:
        return next(iter(best_first(g.best for g in self.generations if g.best is not None)), None)

    @property
    def n_evaluations(self) -> int:
        """Candidates that were tried, the ones that broke included."""
        return sum(g.count("ok") + g.count("failed") for g in self.generations)

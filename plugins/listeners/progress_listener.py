"""The ``progress`` listener: shows how far a generation is, and prints a line for each."""

from __future__ import annotations

import inspect
import sys
from contextlib import ExitStack
from typing import TYPE_CHECKING

from core.hooks import hookimpl
from core.plugins import installed
from core.support.cli import say
from core.support.progress_display import Step, busy
from core.support.text import count_words, number
from core.trial import Evaluation

if TYPE_CHECKING:
    from core.events import Generation, Result, Run
    from core.interfaces import Reply


class ProgressListener:
    """Writes to standard error, so that standard output stays free for results."""

    def __init__(self) -> None:
        self._open = ExitStack()
        self._step: Step | None = None
        self._population = 0
        self._name = ""
        self._count = 0
        self._best = 0.0
        self._calls = 0
        self._usd = 0.0

    @hookimpl
    def run_started(self, run: Run) -> None:
        self._population = run.budget.population
        # Imported here, since each command's start asks for this class's settings.
        from core.support.templates import fill

        fitness = installed().factory("fitness", run.parts["fitness"])
        header = fill(
            "plugins.listeners",
            "header",
            run=run,
            fitness=(inspect.getdoc(fitness) or "").partition("\n")[0],
            material=run.representation.material,
            generations=count_words(run.budget.n_iteration + 1, "generation"),
            refined=run.config.get("evolution", {}).get("refine", 0),
        )
        say(*header.splitlines(), file=sys.stderr)

    @hookimpl
    def generation_started(self, index: int) -> None:
        self._count = 0
        self._best = 0.0
        self._step = self._open.enter_context(busy(f"generation {index}"))
        self._name = self._step.what

    @hookimpl
    def request_composed(self) -> None:
        self._calls += 1
        self._show()

    @hookimpl
    def reply_received(self, reply: Reply) -> None:
        self._calls -= 1
        self._usd += reply.cost_usd or 0.0
        self._show()

    @hookimpl
    def candidate_evaluated(self, evaluation: Evaluation) -> None:
        self._count += 1
        self._best = max(self._best, evaluation.reward)
        self._show()

    def _show(self) -> None:
        """Say how far the generation is: candidates, the best reward, calls under way, and the run's cost so far."""
        if self._step is None:
            return

        best = f"{self._count}/{self._population}  best {number(self._best, 3)}"
        parts = [self._name, best]
        if self._calls:
            parts.append(f"calls under way: {self._calls}")
        if self._usd:
            parts.append(f"{self._usd:.2f} USD")

        self._step.what = "  ".join(parts)

    @hookimpl
    def generation_finished(self, generation: Generation) -> None:
        self._stop()
        rewards = "nothing could be tried"
        best = generation.best_reward
        mean = generation.mean_reward
        if best is not None and mean is not None:
            rewards = f"best {number(best, 3)}  mean {number(mean, 3)}"

        counts = f"{len(generation.evaluations)} candidates"

        for status in ("rejected", "failed"):
            count = generation.count(status)
            if count:
                counts += f", {count} {status}"

        say(f"generation {generation.index}  {rewards}  ({counts})", file=sys.stderr)

    @hookimpl(tryfirst=True)
    def run_finished(self, run: Run, result: Result) -> None:
        self._stop()
        rollouts = count_words(result.rollouts, "rollout")
        took = f"{rollouts}; the run took {result.wall_time_s:.0f} s"
        say(took, file=sys.stderr)

    @hookimpl
    def run_ended(self) -> None:
        self._stop()

    def _stop(self) -> None:
        self._open.close()
        self._step = None

"""Run the loop: ask for candidates, evaluate them, report to the strategy; until the budget or the goal is reached."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import pluggy

from core.design import Candidate, DesignError, Tool
from core.designs.rules import check_tool
from core.errors import LimitReached, UserError
from core.events import INTERRUPTED, Generation, Result
from core.interfaces import Budget, EvolutionStrategy, Fitness, Robot
from core.plugins import describe_part, installed
from core.search.trials import Trials
from core.support.text import shorten
from core.trial import Evaluation


def evolve(
    strategy: EvolutionStrategy,
    fitness: Fitness,
    trials: Trials,
    budget: Budget,
    events: pluggy.PluginManager,
    robot: Robot | None = None,
    expect: Callable[[Candidate], None] = lambda candidate: None,
) -> Result:
    """Run the generations of a strategy, fewer if the highest reward reaches ``budget.stop_reward``.

    What ``trials`` know is not tried again. Tools must suit ``robot``, by default the default one. A limit that the
    strategy runs into, or an interrupt, ends the loop early (`Result.stopped`). ``expect`` may raise where a candidate
    is not what it was when the run was interrupted.
    """
    began = time.monotonic()
    candidates = CheckedCandidates(strategy, robot or installed().default_robot, expect)
    arrived: list[list[Evaluation]] = []  # by generation
    generations: list[Generation] = []
    try:
        for index in itertools.takewhile(
            lambda number: strategy.has_generation(number, budget), itertools.count()
        ):
            events.hook.generation_started(index=index)
            arrived.append([])
            for evaluation in trials.evaluate(candidates, fitness):
                events.hook.candidate_evaluated(evaluation=evaluation)
                arrived[-1].append(evaluation)
            if candidates.limit is not None:
                break
            joined = fitness.recombine(
                [evaluation for generation in arrived for evaluation in generation]
            )
            for evaluation in trials.evaluate(joined, fitness):
                events.hook.candidate_evaluated(evaluation=evaluation)
                arrived[-1].append(evaluation)
            generation = _generation(index, arrived[-1], strategy.tie)
            strategy.tell(generation.evaluations)
            generations.append(generation)
            events.hook.generation_finished(generation=generation)
            reached = generation.best_reward
            if (
                budget.stop_reward is not None
                and reached is not None
                and reached >= budget.stop_reward
            ):
                break
        stopped = candidates.limit
    except KeyboardInterrupt:  # the caller finds it in the result
        stopped = INTERRUPTED
    for index in range(len(generations), len(arrived)):  # the one that was cut short
        if arrived[index]:
            generations.append(_generation(index, arrived[index], strategy.tie))
    return Result(tuple(generations), time.monotonic() - began, stopped, strategy.tie)


def _generation(
    index: int, evaluations: Iterable[Evaluation], tie: float
) -> Generation:
    return Generation(
        index, tuple(sorted(evaluations, key=lambda e: e.candidate.key)), tie
    )


class CheckedCandidates:
    """A strategy's candidates, one generation for each iteration; ``limit`` says which limit ended the last one."""

    def __init__(
        self,
        strategy: EvolutionStrategy,
        robot: Robot,
        expect: Callable[[Candidate], None] = lambda candidate: None,
    ) -> None:
        self._strategy = strategy
        self._robot = robot
        self._expect = expect
        self.limit: str | None = None
        self._sound: Tool | None = (
            None  # the last that was checked; candidates in a row share one
        )

    def __iter__(self) -> Iterator[Candidate]:
        """Raise UserError where the strategy gives something else; it names the strategy."""
        name = describe_part(self._strategy)
        try:
            candidates = self._strategy.ask()
            if not isinstance(candidates, Iterable):
                raise UserError(
                    f"{name}: ask gave {candidates!r}; expected an iterator of Candidate"
                )
            for candidate in candidates:
                if not isinstance(candidate, Candidate):
                    wrong = f"ask gave {shorten(repr(candidate))} among its candidates"
                    raise UserError(f"{name}: {wrong}; expected a Candidate")
                self._expect(candidate)
                yield self._checked(candidate)
        except LimitReached as limit:
            self.limit = str(limit)

    def _checked(self, candidate: Candidate) -> Candidate:
        """Add a problem to a candidate whose tool breaks a rule: a strategy may build tools without the designer."""
        tool = candidate.tool
        if (
            candidate.problem is None
            and tool is not None
            and tool.components
            and tool is not self._sound
        ):
            try:
                check_tool(tool, self._robot)
            except DesignError as error:
                return replace(
                    candidate,
                    problem=f"{describe_part(self._strategy)} built a wrong tool: {error}",
                )
            self._sound = tool
        return candidate

"""Run the loop: ask for candidates, evaluate them, report to the strategy; until the budget or the goal is reached."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import pluggy

from core.design import Candidate, DesignError, Tool
from core.designs.rules import check_tool
from core.errors import LimitReached, UserError
from core.events import INTERRUPTED, Generation, Result
from core.interfaces import Budget, EvolutionStrategy, Robot
from core.plugins import describe_part
from core.search.finalists import Race, evaluate_in_race
from core.support.interrupts import allow_writing
from core.support.text import shorten
from core.trial import Evaluation, count_rollouts
from core.values.efforts import HOLDS


def evolve(
    strategy: EvolutionStrategy,
    race: Race,
    budget: Budget,
    events: pluggy.PluginManager,
    robot: Robot,
    expect: Callable[[Candidate], None] = lambda candidate: None,
    elites: int = 0,
    least: int = 0,
) -> Result:
    """Run the generations of a strategy, fewer if a reward reaches ``budget.stop_reward``.

    A limit that the strategy runs into, or an interrupt, ends the loop early (`Result.stopped`).

    Args:
        strategy: gives the candidates.
        race: has the fitness, the scheduler, and the further layouts.
        budget: of the run.
        events: hear of what happens.
        robot: tools must suit it.
        expect: may raise where a candidate is not what it was when the run was interrupted.
        elites: how many rollouts those that may be elites are tried for after each generation. With any, those
            clearly behind are not tried in all layouts of the search.
        least: how many generations there are whatever they earn: those tried before the run was resumed.
    """
    began = time.monotonic()
    fitness = race.fitness
    allowance = Allowance(budget.n_rollouts, len(fitness.conditions()))
    candidates = CheckedCandidates(strategy, robot, expect, allowance)
    tie = strategy.tie
    tried: list[Evaluation] = []
    generations: list[Generation] = []
    best = 0.0

    def evaluate(asked: Iterable[Candidate]) -> None:
        nonlocal best
        if elites and fitness.races:
            evaluations = evaluate_in_race(asked, fitness, race.trials, tie, best)
        else:
            evaluations = race.trials.evaluate(asked, fitness)
        for evaluation in evaluations:
            events.hook.candidate_evaluated(evaluation=evaluation)
            tried.append(evaluation)
            best = max(best, evaluation.reward)

    try:
        while strategy.has_generation(len(generations), budget):
            events.hook.generation_started(index=len(generations))
            evaluate(candidates)
            if candidates.limit is not None:
                break
            evaluate([*fitness.recombine(tried)])
            if elites and not fitness.finals_check:
                race.follow(tried, elites)
            generation = _make_generation(generations, tried, tie)
            candidates.allowance.settle(generation.evaluations)
            strategy.tell(generation.evaluations)
            generations.append(generation)
            events.hook.generation_finished(generation=generation)
            if len(generations) >= least and _is_enough(generations, budget):
                break
        stopped = candidates.limit
    except KeyboardInterrupt:  # the caller finds it in the result
        allow_writing()
        stopped = INTERRUPTED

    cut_short = _make_generation(generations, tried, tie)
    if cut_short.evaluations:
        generations.append(cut_short)

    return Result(tuple(generations), time.monotonic() - began, stopped, tie)


def _make_generation(
    earlier: Sequence[Generation], tried: Sequence[Evaluation], tie: float
) -> Generation:
    """Make the next generation of what was tried since the earlier ones."""
    known = sum(len(generation.evaluations) for generation in earlier)
    new = sorted(tried[known:], key=lambda evaluation: evaluation.candidate.key)

    return Generation(len(earlier), tuple(new), tie)


def _is_enough(generations: Sequence[Generation], budget: Budget) -> bool:
    """Report whether what was earned so far ends the run."""
    goal = budget.stop_reward
    if goal is None:
        return False

    return any(
        evaluation.reward >= goal and (evaluation.solved or goal < HOLDS)
        for generation in generations
        for evaluation in generation.ranking
    )


@dataclass(eq=False)
class Allowance:
    """The rollouts that a search may still take of ``budget.n_rollouts``.

    Each candidate is counted with a rollout in each condition when it comes. What it really took is known, and
    counted, after its generation: equal candidates share theirs.

    Attributes:
        most: in the whole search; None: there is no limit.
        each: rollouts that a candidate may take.
        taken: so far.
        played: of these in the generations that have ended.
    """

    most: int | None
    each: int
    taken: int = 0
    played: int = 0

    def settle(self, generation: Iterable[Evaluation]) -> None:
        """Count what was really played for the candidates of a generation that has ended."""
        for evaluation in generation:
            self.played += count_rollouts(evaluation.candidate.id, evaluation.trials)
        self.taken = self.played

    def take(self) -> None:
        """Count a candidate.

        Raises:
            LimitReached: there are not enough rollouts left for it.
        """
        if self.most is None:
            return
        left = self.most - self.taken
        if left < self.each:
            raise LimitReached(
                f"budget.n_rollouts={self.most}: {left} left, and a candidate takes {self.each}"
            )

        self.taken += self.each


@dataclass(eq=False)
class CheckedCandidates:
    """A strategy's candidates, one generation for each iteration.

    Attributes:
        strategy: gives them.
        robot: tools must suit it.
        expect: may raise where a candidate is not what it was.
        allowance: the rollouts that are left.
        limit: which limit ended the last generation; None: none did.
    """

    strategy: EvolutionStrategy
    robot: Robot
    expect: Callable[[Candidate], None]
    allowance: Allowance
    limit: str | None = None
    # The last tool that was checked: candidates in a row share one.
    _sound: Tool | None = None
    _ids: set[str] = field(default_factory=set)

    def __iter__(self) -> Iterator[Candidate]:
        """Raise UserError where the strategy gives something else; it names the strategy."""
        name = describe_part(self.strategy)
        try:
            candidates = self.strategy.ask()
            if not isinstance(candidates, Iterable):
                raise UserError(
                    f"{name}: ask gave {candidates!r}; expected an iterator of Candidate"
                )

            for candidate in candidates:
                if not isinstance(candidate, Candidate):
                    wrong = f"ask gave {shorten(repr(candidate))} among its candidates"
                    raise UserError(f"{name}: {wrong}; expected a Candidate")

                if candidate.id in self._ids:
                    raise UserError(
                        f"{name}: ask gave two candidates {candidate.id}; number generations, agents, strategies and "
                        "plans, so that each has an id of its own"
                    )
                self._ids.add(candidate.id)
                self.expect(candidate)
                checked = self._check(candidate)
                if checked.problem is None:
                    self.allowance.take()
                yield checked
        except LimitReached as limit:
            self.limit = str(limit)

    def _check(self, candidate: Candidate) -> Candidate:
        """Add a problem to a candidate whose tool breaks a rule: a strategy may build tools without the designer."""
        tool = candidate.tool
        if candidate.problem is not None or tool is None or not tool.components:
            return candidate
        if tool is self._sound:
            return candidate
        try:
            check_tool(tool, self.robot)
        except DesignError as error:
            name = describe_part(self.strategy)
            return replace(candidate, problem=f"{name} built a wrong tool: {error}")

        self._sound = tool

        return candidate

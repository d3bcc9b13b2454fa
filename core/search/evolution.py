"""Run the loop: ask for candidates, evaluate them, report to the strategy; until the budget or the goal is reached."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace

import pluggy

from core.design import Candidate, DesignError, Tool
from core.designs.rules import check_tool
from core.errors import LimitReached, UserError
from core.events import INTERRUPTED, Generation, Result
from core.interfaces import Budget, EvolutionStrategy, Fitness, Robot
from core.plugins import describe_part, installed
from core.search.finalists import FinalRace, evaluate_in_race
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
    finals: FinalRace | None = None,
) -> Result:
    """Run the generations of a strategy, fewer if the highest reward reaches ``budget.stop_reward``.

    What ``trials`` know is not tried again. Tools must suit ``robot``, by default the default one. A limit that the
    strategy runs into, or an interrupt, ends the loop early (`Result.stopped`). ``expect`` may raise where a candidate
    is not what it was when the run was interrupted. With ``finals`` those clearly behind are not tried in all layouts,
    and those that may be elites in more.
    """
    began = time.monotonic()
    candidates = CheckedCandidates(strategy, robot or installed().default_robot, expect)
    arrived: list[list[Evaluation]] = []  # by generation
    tried: list[Evaluation] = []
    generations: list[Generation] = []

    def try_all(asked: Iterable[Candidate]) -> Iterator[Evaluation]:
        if finals is None or not fitness.races:
            return trials.evaluate(asked, fitness)
        best = max((evaluation.reward for evaluation in tried), default=0.0)
        return evaluate_in_race(asked, fitness, trials, strategy.tie, best)

    def evaluate(asked: Iterable[Candidate]) -> None:
        for evaluation in try_all(asked):
            events.hook.candidate_evaluated(evaluation=evaluation)
            arrived[-1].append(evaluation)
            tried.append(evaluation)

    try:
        while strategy.has_generation(len(generations), budget):
            events.hook.generation_started(index=len(generations))
            arrived.append([])
            evaluate(candidates)
            if candidates.limit is not None:
                break
            evaluate(fitness.recombine([*tried]))
            if finals is not None:
                finals.compare_elites(tried)
            generation = _generation(len(generations), arrived[-1], strategy.tie)
            strategy.tell(generation.evaluations)
            generations.append(generation)
            events.hook.generation_finished(generation=generation)
            if _reaches_goal(generation, budget):
                break
        stopped = candidates.limit
    except KeyboardInterrupt:  # the caller finds it in the result
        stopped = INTERRUPTED

    cut_short = arrived[len(generations) :]
    if cut_short and cut_short[0]:
        generation = _generation(len(generations), cut_short[0], strategy.tie)
        generations.append(generation)

    return Result(tuple(generations), time.monotonic() - began, stopped, strategy.tie)


def _generation(
    index: int, evaluations: Iterable[Evaluation], tie: float
) -> Generation:
    ordered = sorted(evaluations, key=lambda evaluation: evaluation.candidate.key)
    return Generation(index, tuple(ordered), tie)


def _reaches_goal(generation: Generation, budget: Budget) -> bool:
    goal = budget.stop_reward
    best = generation.best_reward
    return goal is not None and best is not None and best >= goal


@dataclass(eq=False)
class CheckedCandidates:
    """A strategy's candidates, one generation for each iteration.

    Attributes:
        strategy: gives them.
        robot: tools must suit it.
        expect: may raise where a candidate is not what it was.
        limit: which limit ended the last generation; None: none did.
    """

    strategy: EvolutionStrategy
    robot: Robot
    expect: Callable[[Candidate], None]
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
                yield self._check(candidate)
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

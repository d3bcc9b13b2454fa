"""Race candidates: try the most promising in more and more layouts, until none that is left can be better.

One race decides three times. In the search it leaves out the layouts that are left of candidates clearly behind. After
each generation it finds the elites that hold, and where all fail. At the end it chooses the winner.

It is a best-first search. A candidate's loss is what it has missed in the layouts that it was tried in; what it has not
been tried in may still lose nothing. So the candidate with the least loss is tried next, where the others lost most.
The first that has been tried in all layouts, and has lost no more than any other, is the best of them there: no trial
of another could change that. It is the bound of A* (P. Hart, N. Nilsson and B. Raphael, "A formal basis for the
heuristic determination of minimum cost paths", 1968). A few layouts are hard for nearly all designs, so most candidates
are out after a handful of trials.

Where the budget ends the race, the candidate with the least expected loss is the best (`Evaluation.expected_loss`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import pluggy

from core.design import Candidate
from core.events import Result
from core.interfaces import Fitness
from core.search.trials import Trials, make_score
from core.trial import Condition, Evaluation, Rewards, Tally, Trial, best_first
from core.values.efforts import Held

WIDTH = 8  # trials in an engine at once
SEARCH_WIDTH = 16  # in the search, where many candidates are alike
# Layouts that candidates are compared in at first; then two times as many, up to the most, while half of the budget
# is left.
FIRST = 64
MOST = 240  # layouts that candidates are compared in at most, and then the winner alone
# Shares of the budget: at most for the choice, and at least for perturbed layouts.
RACED = 0.7
PERTURBED = 0.1


def try_unseen(
    best: Evaluation, fitness: Fitness, trials: Trials
) -> tuple[Rewards, Evaluation]:
    """Return the best candidate's rewards in the unseen conditions of the fitness, by engine, and its trials there.

    All of these are observed: where it fails, the user is told why.
    """
    observed = []
    for condition in fitness.unseen():
        settings = replace(condition.settings, observe=True)
        observed.append(replace(condition, settings=settings))

    ((_, tried),) = trials.try_in(observed, [best.candidate])
    rewards = fitness.rewards(tried) if tried else {}
    return rewards, replace(best, trials=tried)


@dataclass(eq=False)
class Runner:
    """A candidate in a race.

    Attributes:
        candidate: what is tried.
        tally: what came of it so far.
        evaluation: of the search, if that is over.
    """

    candidate: Candidate
    tally: Tally = field(default_factory=Tally)
    evaluation: Evaluation | None = None


@dataclass(eq=False)
class Race:
    """Trials of candidates in more and more layouts.

    Attributes:
        layouts: the conditions of each, without end or not.
        fitness: combines what was earned in a layout.
        trials: the scheduler.
        tie: rewards that miss 1 by no more lose nothing.
        width: how many trials there are in an engine at once.
        tell: hears of each candidate that was tried.
    """

    layouts: Iterator[Sequence[Condition]]
    fitness: Fitness
    trials: Trials
    tie: float
    width: int = WIDTH
    tell: Callable[[Runner], None] = lambda runner: None

    def __post_init__(self) -> None:
        self._drawn: list[Sequence[Condition]] = []
        self.spent = 0  # rollouts, with those that were known

    def run(
        self,
        runners: Sequence[Runner],
        level: int,
        limit: float = math.inf,
        best: float = math.inf,
        reach: float = 0.0,
    ) -> Iterator[None]:
        """Try runners in the first layouts, until none that was not tried in all can be the best; yield after each try.

        Args:
            runners: of those alike the first goes first.
            level: how many layouts.
            limit: how many rollouts the race may have had at the end, about.
            best: what somebody else lost in all layouts.
            reach: whoever may lose less than so much more than the best counts; then others join in their trials.
        """
        while self.spent < limit:
            complete = [r for r in runners if len(r.tally.losses) >= level]
            least = min([best, *(r.tally.loss for r in complete)])
            left = [
                r
                for r in runners
                if len(r.tally.losses) < level and r.tally.loss < least + reach
            ]
            if not left:
                return

            left.sort(key=lambda r: (r.tally.loss, -len(r.tally.losses)))
            leader = left[0]
            others = [r for r in runners if r is not leader]
            numbers = self._choose_layouts(leader, level, others)
            group = [
                r
                for r in left
                if r.tally.losses.keys().isdisjoint(numbers)
                and (reach or r.tally.loss <= leader.tally.loss)
            ]
            self.try_in(group[: self.width // len(numbers)], numbers)
            yield

    def _choose_layouts(
        self, leader: Runner, level: int, others: Sequence[Runner]
    ) -> list[int]:
        """Choose what the leader is tried in next: where others lost, if any did, the most first."""
        left = [n for n in range(level) if n not in leader.tally.losses]
        losses = {number: _hardness(number, others) for number in left}
        left.sort(key=lambda number: -losses[number])
        hard = [number for number in left if losses[number] > 0]
        return (hard or left)[: self.width]

    def hold(self, winner: Runner, limit: float) -> Held:
        """Try the winner alone in layouts that had no part in the choice, and say in how many it held."""
        first = len(self._drawn)
        last = self.draw(first + MOST)
        for number in range(first, last, self.width):
            if self.spent >= limit:
                break
            self.try_in([winner], range(number, min(number + self.width, last)))
        return winner.tally.count_held(first)

    def draw(self, count: int) -> int:
        """Draw layouts until there are ``count``; return how many there are, fewer where there are no more."""
        while len(self._drawn) < count:
            conditions = next(self.layouts, ())
            if not conditions:
                break
            self._drawn.append(conditions)
        return len(self._drawn)

    def conditions(self, numbers: Iterable[int]) -> list[Condition]:
        """Return the conditions of layouts."""
        return [condition for number in numbers for condition in self._drawn[number]]

    def try_in(self, group: Sequence[Runner], numbers: Sequence[int]) -> None:
        """Try runners in layouts, side by side."""
        conditions = self.conditions(numbers)
        self.spent += len(conditions) * len(group)
        candidates = [runner.candidate for runner in group]
        tried = {
            candidate.id: trials
            for candidate, trials in self.trials.try_in(conditions, candidates)
        }
        for runner in group:
            self.note(runner.tally, numbers, tried[runner.candidate.id])
            self.tell(runner)

    def note(
        self, tally: Tally, numbers: Sequence[int], trials: tuple[Trial, ...]
    ) -> None:
        """Note what came of a candidate in layouts."""
        by_engine = self.fitness.rewards(trials)
        size = len(trials) // len(numbers)  # all layouts have as many conditions
        for place, number in enumerate(numbers):
            tally.trials[number] = trials[place * size : (place + 1) * size]
            losses = {}
            for engine, rewards in by_engine.items():
                lost = 1.0 - rewards[place]
                losses[engine] = lost if lost > self.tie else 0.0
            tally.losses[number] = losses


def _hardness(number: int, runners: Sequence[Runner]) -> float:
    """Say how much those lost, on average, that were tried in a layout."""
    known = [
        max(runner.tally.losses[number].values())
        for runner in runners
        if number in runner.tally.losses
    ]
    return sum(known) / max(len(known), 1)


# --- in the search ----------------------------------------------------------------------------------------------


def evaluate_in_race(
    candidates: Iterable[Candidate],
    fitness: Fitness,
    trials: Trials,
    tie: float,
    best: float,
) -> Iterator[Evaluation]:
    """Yield the evaluation of each candidate: those tried in all layouts when they are, then those clearly behind.

    Clearly behind is who would earn less than the best, by more than ``tie``, with all rewards that are left.

    Args:
        candidates: they may still arrive.
        fitness: whose score is a mean (`Fitness.races`).
        trials: the scheduler.
        tie: the difference that counts as none.
        best: the highest score so far.
    """
    conditions = fitness.conditions()
    layouts: dict[int, list[Condition]] = {}
    for condition in conditions:
        layouts.setdefault(condition.layout, []).append(condition)

    race = Race(iter(layouts.values()), fitness, trials, tie, SEARCH_WIDTH)
    level = race.draw(len(layouts))
    runners: list[Runner] = []
    for candidate, tried in trials.try_in(race.conditions([0]), candidates):
        if not tried:
            yield Evaluation(candidate)
            continue
        runner = Runner(candidate)
        race.note(runner.tally, [0], tried)
        runners.append(runner)

    runners.sort(key=lambda runner: runner.candidate.key)
    waiting = list(runners)
    # In each layout a tie may be lost that is not counted, by the best and by those behind.
    lost = level * (1 - best)
    for _ in race.run(runners, level, best=lost, reach=2 * tie * level + 1e-9):
        for runner in tuple(waiting):
            if len(runner.tally.losses) == level:
                waiting.remove(runner)
                yield _evaluate_runner(runner, fitness, conditions, level)

    for runner in waiting:
        yield _evaluate_runner(runner, fitness, conditions, level)


def _evaluate_runner(
    runner: Runner, fitness: Fitness, conditions: Sequence[Condition], level: int
) -> Evaluation:
    """Make a score of what a runner was tried in, of ``level`` layouts; a warning says it if those were not all."""
    known = {trial.where: trial for trial in runner.tally.in_order()}
    tried = tuple(known[c.where] for c in conditions if c.where in known)
    score = make_score(fitness, runner.candidate, tried)
    count = len(runner.tally.trials)
    if count < level:
        left_out = f"tried in {count} of {level} layouts: too far behind to be the best"
        score = replace(score, warnings=(*score.warnings, left_out))
    return Evaluation(runner.candidate, tried, score)


# --- in further layouts -----------------------------------------------------------------------------------------


def pick(ranking: Sequence[Evaluation], tie: float) -> Evaluation:
    """Pick who is expected to lose least; of those alike that were tried as much, who has the shortest way."""
    best = min(ranking, key=lambda evaluation: evaluation.expected_loss)
    least = len(best.finals.losses)
    as_known = [e for e in ranking if len(e.finals.losses) >= least]
    return best_first(as_known, tie)[0]


class FinalRace:
    """The race of a run in further layouts (`Fitness.finals`): of elites after each generation, and of finalists.

    Args:
        fitness: gives the layouts.
        trials: the scheduler.
        events: hear of each candidate that was tried.
        tie: the run's.
        elites: how many rollouts elites are tried for after a generation.
    """

    def __init__(
        self,
        fitness: Fitness,
        trials: Trials,
        events: pluggy.PluginManager,
        tie: float,
        elites: int = 0,
    ) -> None:
        self.fitness = fitness
        self.trials = trials
        self.tie = tie
        self.elites = elites
        self._events = events
        layouts = iter(fitness.finals())
        self._race = Race(layouts, fitness, trials, tie, tell=self._tell)
        self._has_layouts = self._race.draw(1) > 0

    def _tell(self, runner: Runner) -> None:
        if runner.evaluation is not None:
            self._events.hook.finalist_tried(evaluation=runner.evaluation)

    def compare_elites(self, evaluations: Iterable[Evaluation]) -> None:
        """Try those that may hold best of all so far, which `Evaluation.finals` then tell."""
        ranking = best_first(evaluations, self.tie)
        self.compare(ranking, self.elites, FIRST)

    def compare(
        self, ranking: Sequence[Evaluation], rollouts: float, most: int
    ) -> None:
        """Try candidates in at most so many layouts, of those alike the first of a ranking first."""
        alike = self._find_alike(ranking)
        runners = [Runner(e.candidate, e.finals, e) for e in alike]
        race = self._race
        began = race.spent
        level = min(FIRST, race.draw(FIRST))
        while runners:
            for _ in race.run(runners, level, began + rollouts):
                continue
            if race.spent - began > rollouts / 2:
                break
            further = min(2 * level, most)
            further = min(further, race.draw(further))
            if further == level:
                break
            level = further

    def _find_alike(self, ranking: Sequence[Evaluation]) -> list[Evaluation]:
        """Return those within the tie of the highest reward, if that is more than 0; of equal designs one."""
        alike: dict[str, Evaluation] = {}
        highest = max((evaluation.reward for evaluation in ranking), default=0.0)
        for evaluation in ranking:
            if 0 < evaluation.reward >= highest - self.tie:
                alike.setdefault(evaluation.candidate.content, evaluation)
        return list(alike.values())

    def choose(self, result: Result, rollouts: int) -> Result:
        """Return the result with the winner of a search in which something was tried, with about so many rollouts.

        Without `Fitness.finals` the winner is the first of the ranking and nothing is tried.

        Raises:
            UserError: the machine is at fault for a trial that failed.
        """
        ranking = result.ranking
        race = self._race
        alike = self._find_alike(ranking)
        if not (rollouts and self._has_layouts and alike):
            return replace(result, winner=ranking[0])

        end = race.spent + rollouts
        if len(alike) > 1:
            self.compare(alike, RACED * rollouts, MOST)
        winner = pick(alike, self.tie)
        runner = Runner(winner.candidate, winner.finals, evaluation=winner)
        held = race.hold(runner, end - PERTURBED * rollouts)

        finals = {}
        for evaluation in ranking:
            tried = evaluation.finals.in_order()
            if tried:
                finals[evaluation.candidate.id] = self.fitness.rewards(tried)

        perturbed = self._perturb(winner, end - race.spent)
        return replace(
            result, winner=winner, finals=finals, held=held, perturbed=perturbed
        )

    def _perturb(self, winner: Evaluation, rollouts: int) -> Tally:
        """Try the winner with tool and bodies perturbed."""
        layouts = map(self.fitness.perturbed, self.fitness.finals())
        race = Race(layouts, self.fitness, self.trials, self.tie)
        runner = Runner(winner.candidate)
        race.hold(runner, rollouts)
        return runner.tally

"""Choose the winner among candidates that earn alike by trials in more layouts, and try it where no search looked.

The choice is a best-first search. A finalist's loss is what it has missed in the layouts that it was tried in; what it
has not been tried in may still lose nothing. So the finalist with the least loss is tried next, where the others lost
most. The first that has been tried in all layouts, and has lost no more than any other, is the best of them there: no
trial of another could change that. It is the bound of A* (P. Hart, N. Nilsson and B. Raphael, "A formal basis for the
heuristic determination of minimum cost paths", 1968). A few layouts are hard for nearly all designs, so most finalists
are out after a handful of trials.

Where the budget ends the search, the finalist with the least expected loss wins, by Laplace's rule of succession: (loss
+ 1) / (layouts + 2), or where it lost more than half in the search, with twice that in place of 1.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import pluggy

from core.events import Result
from core.interfaces import Fitness
from core.search.trials import Trials
from core.trial import Condition, Evaluation, Rewards, Trial
from core.values.efforts import Effort, Held, holds

WIDTH = 8  # trials in an engine at once
# Layouts that finalists are compared in; twice as many, if the budget allows.
FIRST = 64
MOST = 240  # layouts that a winner is tried in
RACED = 0.75  # of the budget: for the choice; the winner alone is tried in new layouts for the rest


def try_unseen(
    best: Evaluation, fitness: Fitness, trials: Trials
) -> tuple[Rewards, Effort | None]:
    """Return the best candidate's rewards in the unseen conditions of the fitness, by engine, and its effort there."""
    conditions = fitness.unseen()
    if not conditions:
        return {}, None
    ((_, tried),) = trials.try_in(conditions, [best.candidate])
    return fitness.rewards(tried), replace(best, trials=tried).effort


def finalists(result: Result) -> list[Evaluation]:
    """Return those within the tie of the highest reward that were tried, of equal designs one.

    Those with more room to spare go first, a tenth of a limit counting as none, then those with the shorter way.
    """
    ranking = result.ranking
    highest = max((evaluation.reward for evaluation in ranking), default=0.0)
    if highest <= 0:
        return []
    alike: dict[str, Evaluation] = {}
    for evaluation in ranking:
        if evaluation.reward >= highest - result.tie:
            alike.setdefault(evaluation.candidate.content, evaluation)
    return sorted(alike.values(), key=_room, reverse=True)


def _room(evaluation: Evaluation) -> float:
    margin = evaluation.least_margin
    return 0.0 if margin is None else round(margin.margin, 1)


@dataclass(eq=False)
class _Finalist:
    """A finalist, and what it has lost so far: a reward below 1 by more than the tie.

    Attributes:
        evaluation: of the search.
        losses: by the layout's number, and by engine.
        trials: by the layout's number.
    """

    evaluation: Evaluation
    losses: dict[int, dict[str, float]] = field(default_factory=dict)
    trials: dict[int, tuple[Trial, ...]] = field(default_factory=dict)

    @property
    def loss(self) -> float:
        """What it has lost in the engine where that is most."""
        by_engine: dict[str, float] = {}
        for engines in self.losses.values():
            for engine, lost in engines.items():
                by_engine[engine] = by_engine.get(engine, 0.0) + lost
        return max(by_engine.values(), default=0.0)

    @property
    def expected_loss(self) -> float:
        """What it is expected to lose in another layout: before it was tried, half, or more if it lost more so far."""
        usual = max(0.5, 1.0 - self.evaluation.reward)
        return (self.loss + 2 * usual) / (len(self.losses) + 2)

    @property
    def finals(self) -> tuple[Trial, ...]:
        """All trials, in the order of the layouts."""
        return tuple(
            trial for number in sorted(self.trials) for trial in self.trials[number]
        )

    def may_join(self, leader: _Finalist, numbers: Sequence[int]) -> bool:
        """Report whether it may still be as good as another one, and was tried in none of these layouts."""
        untried = self.losses.keys().isdisjoint(numbers)
        return untried and self.loss <= leader.loss

    def worst_loss(self, number: int) -> float | None:
        """Return what it lost in a layout; None: it was not tried there."""
        lost = self.losses.get(number)
        return None if lost is None else max(lost.values())


@dataclass(eq=False)
class Race:
    """Trials of finalists in more and more layouts.

    Attributes:
        fitness: gives the layouts, `Fitness.finals`.
        trials: the scheduler.
        events: hear of each finalist that was tried.
        tie: rewards that miss 1 by no more lose nothing.
        budget: how many rollouts there may be.
    """

    fitness: Fitness
    trials: Trials
    events: pluggy.PluginManager
    tie: float
    budget: int

    def __post_init__(self) -> None:
        self._layouts: Iterator[Sequence[Condition]] = iter(self.fitness.finals())
        self._drawn: list[Sequence[Condition]] = []
        self.spent = 0

    def has_layouts(self) -> bool:
        """Report whether the fitness has layouts for finalists."""
        return self._draw(1) > 0

    def choose(self, ranked: Sequence[Evaluation]) -> list[_Finalist]:
        """Try finalists, and return them, the winner first; ``ranked`` says who wins of those alike."""
        racing = [_Finalist(evaluation) for evaluation in ranked]
        level = self._draw(FIRST)
        limit = RACED * self.budget

        while len(racing) > 1 and level and self.spent < limit:
            leader, *others = sorted(racing, key=_standing)
            left = [number for number in range(level) if number not in leader.losses]
            if left:
                self._try_next(leader, left, others)
            elif 2 * self.spent <= limit and self._draw(min(2 * level, MOST)) > level:
                level = len(self._drawn)
            else:
                break

        winner = _pick(racing, self.tie)
        return sorted(racing, key=lambda finalist: finalist is not winner)

    def _try_next(
        self, leader: _Finalist, left: Sequence[int], others: Sequence[_Finalist]
    ) -> None:
        """Try the leader in layouts that it has ``left``: where others lost, if any did, beside those alike."""
        losses = {number: _hardness(number, others) for number in left}
        hard = [number for number in left if losses[number] > 0]
        if not hard:
            self._try([leader], left[:WIDTH])
            return

        hard.sort(key=lambda number: -losses[number])
        numbers = hard[:WIDTH]
        alike = [other for other in others if other.may_join(leader, numbers)]
        count = WIDTH // len(numbers)
        self._try([leader, *alike][:count], numbers)

    def confirm(self, winner: _Finalist) -> Held:
        """Try the winner in layouts that had no part in the choice."""
        first = len(self._drawn)
        last = self._draw(first + MOST)
        held = 0
        number = first
        while number < last and self.spent < self.budget:
            wave = range(number, min(number + WIDTH, last))
            self._try([winner], wave)
            held += sum(holds(1.0 - max(winner.losses[k].values())) for k in wave)
            number = wave.stop
        return Held(held, number - first)

    def _draw(self, count: int) -> int:
        """Draw layouts until there are ``count``; return how many there are, fewer where there are no more."""
        while len(self._drawn) < count:
            conditions = next(self._layouts, None)
            if conditions is None:
                break
            self._drawn.append(conditions)
        return len(self._drawn)

    def _try(self, group: Sequence[_Finalist], numbers: Sequence[int]) -> None:
        """Try finalists in layouts, side by side."""
        conditions = [
            condition for number in numbers for condition in self._drawn[number]
        ]
        self.spent += len(conditions) * len(group)
        candidates = [finalist.evaluation.candidate for finalist in group]
        tried = {
            candidate.id: trials
            for candidate, trials in self.trials.try_in(conditions, candidates)
        }

        for finalist in group:
            found = tried[finalist.evaluation.candidate.id]
            self._note(finalist, numbers, found)
            evaluation = replace(finalist.evaluation, finals=finalist.finals)
            self.events.hook.finalist_tried(evaluation=evaluation)

    def _note(
        self, finalist: _Finalist, numbers: Sequence[int], trials: tuple[Trial, ...]
    ) -> None:
        """Note what came of a finalist in layouts."""
        by_engine = self.fitness.rewards(trials)
        first = 0
        for place, number in enumerate(numbers):
            last = first + len(self._drawn[number])
            finalist.trials[number] = trials[first:last]
            first = last

            losses = {}
            for engine, rewards in by_engine.items():
                lost = 1.0 - rewards[place]
                losses[engine] = lost if lost > self.tie else 0.0
            finalist.losses[number] = losses


def _pick(racing: Sequence[_Finalist], tie: float) -> _Finalist:
    """Pick the one that is expected to lose least, or the first that was tried as much and is within the tie of it."""
    best = min(racing, key=lambda finalist: finalist.expected_loss)
    for finalist in racing:
        as_known = len(finalist.losses) >= len(best.losses)
        if as_known and finalist.expected_loss <= best.expected_loss + tie:
            return finalist
    return best


def _standing(finalist: _Finalist) -> tuple[float, int]:
    """Sort those who lost least first, and of these those who were tried most."""
    return finalist.loss, -len(finalist.losses)


def _hardness(number: int, finalists: Sequence[_Finalist]) -> float:
    """Say how much those lost, on average, that were tried in a layout."""
    lost = [finalist.worst_loss(number) for finalist in finalists]
    known = [loss for loss in lost if loss is not None]
    return float(np.mean(known)) if known else 0.0


@dataclass(frozen=True)
class Choice:
    """The winner of a run, with its trials as a finalist.

    Attributes:
        winner: its evaluation.
        finals: what each finalist earned, by its id and engine.
        held: in how many layouts that had no part in the choice the winner held.
    """

    winner: Evaluation
    finals: Mapping[str, Rewards] = field(default_factory=dict)
    held: Held | None = None


def choose(
    result: Result,
    fitness: Fitness,
    trials: Trials,
    events: pluggy.PluginManager,
    budget: int,
) -> Choice:
    """Choose the winner of a run in which something was tried, with about ``budget`` rollouts.

    Means within the run's tie are equal; then the order of `finalists` decides. Without `Fitness.finals` the winner is
    the first of the ranking and nothing is tried.

    Raises:
        UserError: the machine is at fault for a trial that failed.
    """
    alike = finalists(result)
    race = Race(fitness, trials, events, result.tie, budget)
    if not (alike and budget and race.has_layouts()):
        return Choice(result.ranking[0])

    racing = race.choose(alike)
    held = race.confirm(racing[0])
    finals = {}
    for finalist in racing:
        if finalist.trials:
            finals[finalist.evaluation.candidate.id] = fitness.rewards(finalist.finals)
    winner = replace(racing[0].evaluation, finals=racing[0].finals)
    return Choice(winner, finals, held)

"""Race candidates: try the most promising in more and more layouts, until none that is left can be better.

One race decides three times. In the search it leaves out the layouts that are left of candidates clearly behind. After
each generation it finds the elites that hold, and where all fail. At the end it chooses the winner.

It is a best-first search. A candidate's loss is what it has missed in the layouts that it was tried in; what it has not
been tried in may still lose nothing. So the candidate with the least loss is tried next, where the others lost most.
The first that has been tried in all layouts, and has lost no more than any other, is the best of them there: no trial
of another could change that. It is the bound of A* (P. Hart, N. Nilsson and B. Raphael, "A formal basis for the
heuristic determination of minimum cost paths", 1968). A few layouts are hard for nearly all designs, so most candidates
are out after a handful of trials.

Where the budget ends the race, the two that are assured most (`Evaluation.assured`) are tried side by side in layouts
that were picked for neither, and that decides. Layouts that were picked because others lost there say less of a design.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from core.design import Candidate
from core.events import Result
from core.interfaces import Fitness
from core.search.makers import Judge
from core.search.trials import Trials, make_score
from core.support.progress_display import busy
from core.trial import (
    WHAT_DECIDES,
    Condition,
    Evaluation,
    Trial,
    best_first,
    count_lost,
    rank,
)
from core.values.efforts import HOLDS, Held

WIDTH = 8  # trials in an engine at once
SEARCH_WIDTH = 16  # in the search, where many candidates are alike
# Layouts that candidates are compared in at first; then two times as many, up to the most, while half of the budget
# is left.
FIRST = 64
MOST = 240  # layouts that candidates are compared in at most, and then the winner alone
# Shares of the budget: at most for the race and for the whole choice, and at least for perturbed layouts.
RACED = 0.7
CHOSEN = 0.8
PERTURBED = 0.1
_BUSY = "trying the best in more layouts"
# How long trials take is counted, so that a winner does not depend on the machine.
PER_S = 8  # rollouts of rigid bodies in a second, on two cores
SOFT_PER_S = 1  # of soft ones


def rollouts_in(fitness: Fitness, seconds: float) -> int:
    """Return how many rollouts in further layouts count as so many seconds."""
    if seconds == 0:
        return 0

    layout = next(iter(fitness.finals()), ())
    soft = any(condition.scene().softs for condition in layout)
    return round(seconds * (SOFT_PER_S if soft else PER_S))


@dataclass(eq=False)
class Race:
    """Trials of candidates in more and more layouts. What comes of each runner is noted in its `Evaluation.finals`.

    Attributes:
        layouts: the conditions of each, without end or not.
        fitness: combines what was earned in a layout.
        trials: the scheduler.
        tie: the difference that counts as none.
        width: how many trials there are in an engine at once.
        judge: says whose tools can be made; None: that does not count.
        tell: hears of each runner that was tried.
        spent: rollouts, with those that were known.
    """

    layouts: Iterator[Sequence[Condition]]
    fitness: Fitness
    trials: Trials
    tie: float
    width: int = WIDTH
    judge: Judge | None = None
    tell: Callable[[Evaluation], None] = lambda runner: None
    spent: int = 0

    def __post_init__(self) -> None:
        self._drawn: list[Sequence[Condition]] = []
        self._slack = self.tie  # rewards that miss 1 by no more lose nothing
        self._say: Callable[[int], None] = lambda spent: None
        self._followed = 0
        self._leaders: list[Evaluation] = []

    def draw(self, count: int) -> int:
        """Draw layouts until there are ``count``; return how many of these there are."""
        while len(self._drawn) < count:
            conditions = next(self.layouts, ())
            if not conditions:
                break
            self._drawn.append(conditions)

        return min(count, len(self._drawn))

    def step(
        self,
        runners: Sequence[Evaluation],
        level: int,
        best: float = math.inf,
        reach: float = 0.0,
    ) -> bool:
        """Try the runners that may be the best, side by side, in some of the first layouts.

        Args:
            runners: of those alike the first goes first.
            level: how many layouts.
            best: what another candidate lost in all layouts.
            reach: how much more than the best a candidate may lose and still count; then others join in its trials.

        Returns:
            Whether anybody was tried. Else none that was not tried in all layouts can be the best.
        """
        complete = [
            runner.finals.loss for runner in runners if runner.finals.count >= level
        ]
        bound = min([best, *complete]) + reach
        left = [
            runner
            for runner in runners
            if runner.finals.count < level and runner.finals.loss < bound
        ]
        if not left:
            return False

        left.sort(key=lambda runner: (runner.finals.loss, -runner.finals.count))
        leader = left[0]

        numbers = self._choose_layouts(leader, level, runners)
        group = [
            runner
            for runner in left
            if runner.finals.losses.keys().isdisjoint(numbers)
            and (reach or runner.finals.loss <= leader.finals.loss)
        ]

        self._try_in(group[: self.width // len(numbers)], numbers)
        return True

    def _choose_layouts(
        self, leader: Evaluation, level: int, runners: Sequence[Evaluation]
    ) -> list[int]:
        """Choose what the leader is tried in next: where others lost, if any did, the most on average first."""
        hardness: dict[int, float] = {}
        for number in range(level):
            if number in leader.finals.losses:
                continue

            losses = [runner.finals.losses.get(number) for runner in runners]
            known = [max(lost.values()) for lost in losses if lost is not None]
            hardness[number] = sum(known) / max(len(known), 1)

        left = sorted(hardness, key=lambda number: -hardness[number])
        hard = [number for number in left if hardness[number] > 0]
        return (hard or left)[: self.width]

    def _try_in(self, group: Sequence[Evaluation], numbers: Sequence[int]) -> None:
        """Try runners in layouts, side by side."""
        conditions = [where for number in numbers for where in self._drawn[number]]
        self.spent += len(conditions) * len(group)
        candidates = [runner.candidate for runner in group]
        tried = dict(self.trials.try_in(conditions, candidates))

        for runner in group:
            self.note(runner, numbers, tried[runner.candidate])
            self.tell(runner)

        self._say(self.spent)

    def note(
        self, runner: Evaluation, numbers: Sequence[int], trials: tuple[Trial, ...]
    ) -> None:
        """Note what came of a runner in layouts."""
        by_engine = self.fitness.rewards(trials)
        size = len(trials) // len(numbers)  # all layouts have as many conditions

        for place, number in enumerate(numbers):
            there = trials[place * size : (place + 1) * size]
            runner.finals.trials[number] = there
            runner.finals.losses[number] = {
                engine: self._count_lost(rewards[place], engine, there)
                for engine, rewards in by_engine.items()
            }

    def _count_lost(self, reward: float, engine: str, trials: Sequence[Trial]) -> float:
        """Compute what a runner lost in a layout in an engine. What only checks a choice asks no more than a reward."""
        asked = [trial for trial in trials if trial.engine == engine]
        return count_lost(
            reward, [] if self.fitness.finals_check else asked, self._slack
        )

    def compare(
        self, ranking: Sequence[Evaluation], rollouts: float, most: int
    ) -> None:
        """Try those alike at the head of a ranking, until one has been tried in all layouts and is the best there.

        Args:
            ranking: the best first; of those alike the first goes first.
            rollouts: the budget; while half of it is left, there are two times as many layouts.
            most: how many layouts at most.
        """
        runners = _find_alike(ranking, self.tie)
        began = self.spent
        level = 0
        further = self.draw(FIRST)

        while further > level:
            level = further
            while self.spent < began + rollouts and self.step(runners, level):
                continue

            if self.spent <= began + rollouts / 2:
                further = self.draw(min(2 * level, most))

    def follow(self, tried: Sequence[Evaluation], rollouts: float) -> None:
        """Compare those at the head of all candidates of a search so far, with about so many rollouts.

        Who was once behind stays behind: a long search does not rank all again after each generation.

        Args:
            tried: all of them, those of the last call first.
            rollouts: the budget.
        """
        known = [*self._leaders, *tried[self._followed :]]
        self._followed = len(tried)
        highest = max((evaluation.reward for evaluation in known), default=0.0)
        self._leaders = [
            evaluation
            for evaluation in known
            if evaluation.reward >= highest - self.tie
        ]
        self.compare(best_first(self._leaders, self.tie), rollouts, FIRST)

    def decide(self, alike: Sequence[Evaluation], limit: float) -> Evaluation:
        """Choose the winner: who is proven best, else of the leading two who earns more where both are tried.

        Args:
            alike: tried in some layouts, or not.
            limit: no more are tried once so many rollouts are `spent`.
        """
        proven = self._find_proven(alike)
        if proven:
            return self._put_first(best_first(proven, self.tie))[0]

        ranking = best_first(alike, self.tie)
        if len(ranking) == 1:
            return ranking[0]

        leader, other = ranking[:2]
        self._try_further([leader, other], limit)
        return _pick_of_two(leader, other, self.tie)

    def _put_first(self, alike: Sequence[Evaluation]) -> list[Evaluation]:
        """Put the lightest tool first that can be made, and the others behind it, lighter ones before; see `judge`."""
        if self.judge is None or not self.judge.decides:
            return list(alike)

        lightest = sorted(alike, key=_weigh)
        first = self.judge.find_first(lightest)
        if first is None:
            return list(alike)

        return [first, *(runner for runner in lightest if runner is not first)]

    def _choose_alike(self, alike: Sequence[Evaluation], rollouts: int) -> Evaluation:
        """Choose the winner of those that earn alike. Where its tool can't be made, one that holds alike may do.

        Args:
            alike: the best first.
            rollouts: for the whole choice.
        """
        began = self.spent
        end = began + CHOSEN * rollouts
        left = self._put_first(alike)
        if len(left) > 1:
            self.compare(left, RACED * rollouts, MOST)

        winner = self.decide(left, end)
        if self.judge is None or not self.judge.decides:
            return winner
        making = self.judge.judge(winner)
        if making is None or making.possible is not False:
            return winner

        # Only tools that can be made are tried against it: to look at one takes longer than many rollouts.
        left.sort(key=_weigh)
        tried = winner
        while self.spent < end:
            tool = tried.candidate.tool
            left = [runner for runner in left if runner.candidate.tool != tool]
            other = self.judge.find_first(left)
            if other is None:
                break

            self.compare([other], end - self.spent, MOST)
            if _holds_alike(other, winner, self.tie):
                return other
            tried = other

        return winner

    def _find_proven(self, alike: Sequence[Evaluation]) -> list[Evaluation]:
        """Return those that were tried in as many layouts as any, and lost no more than anyone: none can be better."""
        most = max(runner.finals.count for runner in alike)
        least = min(runner.finals.loss for runner in alike)
        if most < FIRST:
            return []

        return [
            runner
            for runner in alike
            if runner.finals.count == most and runner.finals.loss <= least
        ]

    def hold(self, winner: Evaluation, limit: float) -> Held:
        """Try the winner alone in layouts that had no part in the choice, and say in how many it held.

        Args:
            winner: a runner.
            limit: no more are tried once so many rollouts are `spent`.
        """
        first = self._try_further([winner], limit)
        return winner.finals.count_held(first)

    def _try_further(self, group: Sequence[Evaluation], limit: float) -> int:
        """Try runners side by side in layouts that were not drawn before; return the number of the first of these."""
        first = len(self._drawn)
        last = self.draw(first + MOST)
        step = self.width // len(group)
        for number in range(first, last, step):
            if self.spent >= limit:
                break
            self._try_in(group, range(number, min(number + step, last)))

        return first

    def choose(self, result: Result, rollouts: int) -> Result:
        """Return the result with the winner of a search in which something was tried, with about so many rollouts.

        Without further layouts the winner is the first of the ranking and nothing is tried.

        Raises:
            UserError: the machine is at fault for a trial that failed.
        """
        alike = _find_alike(result.ranking, self.tie)
        if not (rollouts and alike and self.draw(1)):
            return replace(result, winner=result.ranking[0])

        if self.fitness.finals_check:
            highest = max(evaluation.reward for evaluation in alike)
            self._slack = max(self.tie, 1 - HOLDS * highest)

        began = self.spent
        end = began + rollouts

        with busy(_BUSY) as step:

            def say(spent: int) -> None:
                step.what = f"{_BUSY}: {spent - began} of {rollouts} rollouts"

            self._say = say
            winner = self._choose_alike(alike, rollouts)
            held = self.hold(winner, end - PERTURBED * rollouts)

        finals = {
            evaluation.candidate.id: self.fitness.rewards(evaluation.finals.in_order())
            for evaluation in result.ranking
            if evaluation.finals.count
        }

        layouts = map(self.fitness.perturbed, self.fitness.finals())
        runner = Evaluation(winner.candidate)
        perturbed = Race(layouts, self.fitness, self.trials, self.tie)
        with busy(f"{_BUSY}, with tool and bodies perturbed"):
            perturbed.hold(runner, end - self.spent)

        return replace(
            result, winner=winner, finals=finals, held=held, perturbed=runner.finals
        )


def _holds_alike(runner: Evaluation, other: Evaluation, tie: float) -> bool:
    """Report whether a runner assures and earned no less than another one."""
    assured = other.assured - runner.assured
    return assured <= tie and other.mean - runner.mean <= tie


def _weigh(runner: Evaluation) -> float:
    """Return the mass of a runner's tool, kg; 0 where the user named another figure that decides."""
    tool = runner.candidate.tool
    return 0.0 if tool is None or runner.score.cost is not None else tool.mass


def _pick_of_two(leader: Evaluation, other: Evaluation, tie: float) -> Evaluation:
    """Pick who lost less in the layouts that both were tried in; of those alike `WHAT_DECIDES` decides.

    Args:
        leader: the first of the two in the ranking.
        other: the second.
        tie: the difference of mean rewards that counts as none.
    """
    common = sorted(leader.finals.losses.keys() & other.finals.losses.keys())
    if not common:
        return leader

    lost = leader.finals.loss_in(common) - other.finals.loss_in(common)
    if lost > tie * len(common):
        return other

    is_alike = abs(lost) <= tie * len(common)
    return rank([leader, other], WHAT_DECIDES)[0] if is_alike else leader


def _find_alike(ranking: Sequence[Evaluation], tie: float) -> list[Evaluation]:
    """Return those within the tie of the highest reward, if that is more than 0; of equal designs one."""
    alike: dict[str, Evaluation] = {}
    highest = max((evaluation.reward for evaluation in ranking), default=0.0)
    for evaluation in ranking:
        if 0 < evaluation.reward >= highest - tie:
            alike.setdefault(evaluation.candidate.content, evaluation)

    return list(alike.values())


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
    runners: list[Evaluation] = []
    for candidate, tried in trials.try_in(next(iter(layouts.values())), candidates):
        runner = Evaluation(candidate)
        if not tried:
            yield runner
            continue

        race.note(runner, [0], tried)
        runners.append(runner)

    runners.sort(key=lambda runner: runner.candidate.key)
    waiting = list(runners)
    # In each layout a tie may be lost that is not counted, by the best and by those behind.
    reach = 2 * tie * level + 1e-9

    while race.step(runners, level, level * (1 - best), reach):
        for runner in tuple(waiting):
            if runner.finals.count == level:
                waiting.remove(runner)
                yield _evaluate_runner(runner, fitness, conditions, level)

    for runner in waiting:
        yield _evaluate_runner(runner, fitness, conditions, level)


def _evaluate_runner(
    runner: Evaluation, fitness: Fitness, conditions: Sequence[Condition], level: int
) -> Evaluation:
    """Make a score of what a runner was tried in, of ``level`` layouts; a warning says it if those were not all."""
    known = {trial.where: trial for trial in runner.finals.in_order()}
    tried = tuple(known[c.where] for c in conditions if c.where in known)
    score = make_score(fitness, runner.candidate, tried)
    count = runner.finals.count

    if count < level:
        left_out = f"tried in {count} of {level} layouts: too far behind to be the best"
        score = replace(score, warnings=(*score.warnings, left_out))

    return Evaluation(runner.candidate, tried, score)


# --- at the end -------------------------------------------------------------------------------------------------


def choose_winner(result: Result, race: Race, seconds: float) -> Result:
    """Choose the winner of a search in which something was tried, and try it where no search looked.

    Args:
        result: of the search.
        race: in further layouts.
        seconds: for how long candidates are tried there (`Budget.final_s`).
    """
    fitness = race.fitness
    result = race.choose(result, rollouts_in(fitness, seconds))
    winner = result.winner
    assert winner is not None

    tried = try_unseen(winner.candidate, fitness, race.trials)
    effort = replace(winner, trials=tried).effort
    unseen = fitness.rewards(tried)
    result = replace(result, unseen=unseen, unseen_trials=tried, effort=effort)
    return result if race.judge is None else note_making(result, race.judge)


def note_making(result: Result, judge: Judge) -> Result:
    """Return the result with whether the winner's tool can be made, and where it can't, which candidate's can."""
    winner = result.best
    assert winner is not None
    making = judge.judge(winner)
    makeable = None
    if judge.decides and making is not None and making.possible is False:
        makeable = judge.find_first(result.ranking)

    return replace(result, making=making, makeable=makeable)


def try_unseen(
    candidate: Candidate, fitness: Fitness, trials: Trials
) -> tuple[Trial, ...]:
    """Return the trials of the best candidate in the unseen conditions of the fitness.

    All of these are observed: where it fails, the user is told why.
    """
    observed = []
    for condition in fitness.unseen():
        settings = replace(condition.settings, observe=True)
        observed.append(replace(condition, settings=settings))

    ((_, tried),) = trials.try_in(observed, [candidate])
    return tried

"""Checks that every fitness must pass. Each takes a factory, ``make(condition)``, and raises an AssertionError.

A fitness plays nothing itself, so its checks need no rollout: they give it trials.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain, islice

import numpy as np

from core.design import Candidate
from core.errors import RAISED
from core.interfaces import Condition, Fitness, Score, Task, Trial, Waypoints
from core.plugins import PluginPart
from core.trial import Evaluation, Status
from plugins.conformance.sample_tools import stick
from plugins.conformance.shared import (
    as_json,
    between,
    expect_a,
    ready,
    some_simulator,
    some_task,
)
from plugins.conformance.task import layout_of

Make = Callable[[Condition], Fitness]
MOST_FINALS = 100  # that are looked at: there may be no end to them


def condition() -> Condition:
    """The first task, with layouts that differ if it has some, in the first engine that is installed."""
    task = PluginPart[Task]("task", ready("task")[0])
    for variation in list(task.declared("variations", {}))[:1]:
        task = replace(task, settings=(("variation", variation),))

    return Condition(task, PluginPart("sim", some_simulator()[0]))


def _candidate() -> Candidate:
    """A stick that stays at home."""
    home = some_task().home
    return Candidate(stick(0.1), Waypoints(np.array([[*home.position, *home.rpy]])))


def _trials(
    fitness: Fitness, rewards: Sequence[float], status: Status = "ok"
) -> list[Trial]:
    """Make a trial in each condition of a fitness; they earn the rewards in turn."""
    name = _candidate().id
    reason = "" if status == "ok" else "it broke"
    measured = {"distance_m": 1.0, "motion_s": 2.0}
    trials = []
    for number, tried_in in enumerate(fitness.conditions()):
        earned = rewards[number % len(rewards)]
        trials.append(
            Trial(tried_in.where, name, status, earned, reason, measured=measured)
        )

    return trials


def _scores(make: Make) -> list[Score]:
    """The scores of trials that earned nothing, half, all, and different rewards."""
    fitness = make(condition())
    scores = []
    for rewards in ((0.0,), (0.5,), (1.0,), (0.2, 0.9)):
        scores.append(fitness.score(_candidate(), _trials(fitness, rewards)))

    return scores


def check_it_names_conditions(make: Make) -> None:
    """What it tries, in the search and beyond it, are conditions, each of them once."""
    fitness = make(condition())
    expect_a(str, fitness.instructions(), "instructions returned")
    assert fitness.conditions(), "conditions is empty: a candidate is tried nowhere"

    for what, found in {
        "conditions": fitness.conditions(),
        "unseen": fitness.unseen(),
        "finals": list(chain(*islice(fitness.finals(), MOST_FINALS))),
    }.items():
        for value in found:
            expect_a(Condition, value, f"{what} has")

        places = [value.where for value in found]
        repeated = sorted({str(place) for place in places if places.count(place) > 1})
        message = f"{what} repeats {', '.join(repeated)}; each place is tried once"
        assert not repeated, message


def check_the_search_does_not_see_the_unseen(make: Make) -> None:
    """No condition of the search is among those by which the best is judged at the end."""
    fitness = make(condition())
    seen = {searched.where for searched in fitness.conditions()}
    both = sorted(str(last.where) for last in fitness.unseen() if last.where in seen)
    assert not both, f"the search sees what should be unseen: {', '.join(both)}"


def check_conditions_travel_to_workers(make: Make) -> None:
    """Conditions can be pickled, and a copy is the same condition."""
    for sent in make(condition()).conditions():
        try:
            copy = pickle.loads(pickle.dumps(sent))  # noqa: S301 - written in this line
        except RAISED as error:
            what = "a condition can't be pickled, and workers need a copy"
            raise AssertionError(f"{what}: {error}") from error

        what = (
            "a pickled condition is another one; let what it holds be compared by value"
        )
        assert copy == sent, what
        assert hash(copy) == hash(sent), what


def check_a_change_is_the_same_each_time(make: Make) -> None:
    """What perturbs scenes and tools perturbs them alike each time: where it is asked again, and in each worker."""
    fitness = make(condition())
    further = next(fitness.finals(), ())
    for where in (*fitness.conditions(), *further, *fitness.perturbed(further)):
        first, again = (layout_of(where.scene()) for _ in range(2))
        assert first == again, "a change gives another scene each time"
        tool, same = (where.perturb(_candidate()).content for _ in range(2))
        assert tool == same, "a change gives another tool each time"


def check_a_race_may_leave_trials_out(make: Make) -> None:
    """Where layouts are raced, a candidate that is clearly behind is scored by the trials that it has."""
    fitness = make(condition())
    if fitness.races:
        score = fitness.score(_candidate(), _trials(fitness, (0.5,))[:1])
        between(
            "the score of a candidate with one trial of its layouts", score.reward, 0, 1
        )


def check_scores_are_rewards(make: Make) -> None:
    """Scores lie between 0 and 1, and their figures can be written down."""
    for score in _scores(make):
        expect_a(Score, score, "score returned")
        assert 0 <= score.reward <= 1, f"a reward is {score.reward}, not in [0, 1]"
        as_json(dict(score.figures), "what a score has as figures")


def check_the_same_trials_score_the_same(make: Make) -> None:
    """A score depends on nothing but the trials: not on chance, and not on what was scored before."""
    first, again = ([score.reward for score in _scores(make)] for _ in range(2))
    assert first == again, (
        f"the same trials scored {first}, then {again}; a score follows from the trials alone"
    )


def check_what_fails_earns_nothing(make: Make) -> None:
    """Trials that were rejected or failed have the reward 0, in each condition."""
    fitness = make(condition())
    for status in ("rejected", "failed"):
        found = fitness.score(_candidate(), _trials(fitness, (0.0,), status)).reward
        assert found == 0, (
            f"a candidate whose trials were all {status} scores {found}, not 0"
        )


def check_a_rejection_counts_where_it_is(make: Make) -> None:
    """A candidate that is rejected in one condition and succeeds in others is no rejected candidate."""
    fitness = make(condition())
    found = _trials(fitness, (0.0, 0.5))
    if len(found) < 2:
        return

    found[0] = replace(found[0], status="rejected", reason="it starts inside a body")
    score = fitness.score(_candidate(), found)
    status = Evaluation(_candidate(), tuple(found), score).status
    what = f"a candidate that is rejected in one condition alone counts as {status}"
    mend = "let Score.shown be a trial that succeeded"
    assert status == "ok", f"{what}: {mend}"

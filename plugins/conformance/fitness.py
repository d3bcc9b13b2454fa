"""Checks that every fitness must pass. Each takes a factory, ``make(condition)``, and raises an AssertionError.

A fitness plays nothing itself, so its checks need no rollout: they give it trials.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice

import numpy as np

from core.design import Candidate
from core.errors import RAISED
from core.interfaces import Condition, Fitness, Score, Task, Trial, Waypoints
from core.plugins import PluginPart
from core.trial import Evaluation, Status
from plugins.conformance.scenery import stick
from plugins.conformance.shared import (
    as_json,
    between,
    expect,
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


def candidate() -> Candidate:
    """A stick that stays at home."""
    home = some_task().home

    return Candidate(stick(0.1), Waypoints(np.array([[*home.position, *home.rpy]])))


def trials(
    fitness: Fitness, rewards: Sequence[float], status: Status = "ok"
) -> list[Trial]:
    """Make a trial in each condition of a fitness.

    Args:
        fitness: names the conditions.
        rewards: what they earn, in turn.
        status: of all of them.
    """
    name = candidate().id
    found = []

    for number, tried_in in enumerate(fitness.conditions()):
        reward = rewards[number % len(rewards)]
        reason = "" if status == "ok" else "it broke"
        where = tried_in.where
        measured = {"distance_m": 1.0, "motion_s": 2.0}
        trial = Trial(where, name, status, reward, reason, measured=measured)
        found.append(trial)

    return found


def scores(make: Make) -> Iterator[Score]:
    """Yield the scores of trials that earned nothing, half, all, and different rewards."""
    fitness = make(condition())
    for rewards in ((0.0,), (0.5,), (1.0,), (0.2, 0.9)):
        yield fitness.score(candidate(), trials(fitness, rewards))


def check_it_names_conditions(make: Make) -> None:
    """What it tries, in the search and beyond it, are conditions, each of them once."""
    fitness = make(condition())
    text = fitness.instructions()
    expect(isinstance(text, str), f"instructions returned {text!r}, not a text")

    for what, found in {
        "conditions": fitness.conditions(),
        "unseen": fitness.unseen(),
        "finals": list(chain(*islice(fitness.finals(), MOST_FINALS))),
    }.items():
        for value in found:
            expect_a(Condition, value, f"{what} has")

        places = [value.where for value in found]
        repeated = sorted({str(place) for place in places if places.count(place) > 1})
        expect(
            not repeated,
            f"{what} repeats {', '.join(repeated)}; each place is tried once",
        )

    expect(
        len(fitness.conditions()) > 0,
        "conditions is empty: a candidate is tried nowhere",
    )


def check_the_search_does_not_see_the_unseen(make: Make) -> None:
    """No condition of the search is among those by which the best is judged at the end."""
    fitness = make(condition())
    seen = {searched.where for searched in fitness.conditions()}
    unseen = [last.where for last in fitness.unseen()]
    both = sorted(str(where) for where in unseen if where in seen)
    expect(not both, f"the search sees what should be unseen: {', '.join(both)}")


def check_conditions_travel_to_workers(make: Make) -> None:
    """Conditions can be pickled, and a copy is the same condition."""
    for sent in make(condition()).conditions():
        try:
            copy = pickle.loads(pickle.dumps(sent))  # noqa: S301 - written in this line
        except RAISED as error:
            raise AssertionError(
                f"a condition can't be pickled, and workers need a copy: {error}"
            ) from error

        expect(
            copy == sent and hash(copy) == hash(sent),
            "a pickled condition is another one; let what it holds be compared by value",
        )


def check_a_change_is_the_same_each_time(make: Make) -> None:
    """What perturbs scenes and tools perturbs them alike each time: where it is asked again, and in each worker."""
    fitness = make(condition())
    further = next(fitness.finals(), ())
    changed = (*fitness.conditions(), *further, *fitness.perturbed(further))

    for where in changed:
        scenes = [layout_of(where.scene()) for _ in range(2)]
        expect(scenes[0] == scenes[1], "a change gives another scene each time")
        tools = [where.perturb(candidate()).content for _ in range(2)]
        expect(tools[0] == tools[1], "a change gives another tool each time")


def check_a_race_may_leave_trials_out(make: Make) -> None:
    """Where layouts are raced, a candidate that is clearly behind is scored by the trials that it has."""
    fitness = make(condition())
    if fitness.races:
        score = fitness.score(candidate(), trials(fitness, (0.5,))[:1])
        between(
            "the score of a candidate with one trial of its layouts", score.reward, 0, 1
        )


def check_scores_are_rewards(make: Make) -> None:
    """Scores lie between 0 and 1, and their figures can be written down."""
    for score in scores(make):
        expect_a(Score, score, "score returned")
        expect(0 <= score.reward <= 1, f"a reward is {score.reward}, not in [0, 1]")
        as_json(dict(score.figures), "what a score has as figures")


def check_the_same_trials_score_the_same(make: Make) -> None:
    """A score depends on nothing but the trials: not on chance, and not on what was scored before."""
    first = [score.reward for score in scores(make)]
    second = [score.reward for score in scores(make)]
    expect(
        first == second,
        f"the same trials scored {first}, then {second}; a score follows from the trials alone",
    )


def check_what_fails_earns_nothing(make: Make) -> None:
    """Trials that were rejected or failed have the reward 0, in each condition."""
    fitness = make(condition())

    for status in ("rejected", "failed"):
        score = fitness.score(candidate(), trials(fitness, (0.0,), status))
        expect(
            score.reward == 0,
            f"a candidate whose trials were all {status} scores {score.reward}, not 0",
        )


def check_a_rejection_counts_where_it_is(make: Make) -> None:
    """A candidate that is rejected in one condition and succeeds in others is no rejected candidate."""
    fitness = make(condition())
    found = trials(fitness, (0.0, 0.5))
    if len(found) < 2:
        return

    found[0] = replace(found[0], status="rejected", reason="it starts inside a body")
    score = fitness.score(candidate(), found)
    status = Evaluation(candidate(), tuple(found), score).status
    expect(
        status == "ok",
        f"a candidate that is rejected in one condition alone counts as {status}: let Score.shown be a trial that "
        "succeeded",
    )

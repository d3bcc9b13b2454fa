"""Of candidates that earn alike, more trials choose the winner."""

import itertools
import json

import numpy as np
import pytest

from core.config.compose import load
from core.design import Candidate
from core.errors import UserError
from core.events import Generation, Result
from core.hooks import hookimpl
from core.interfaces import Condition, Fitness, Trial
from core.plugins import event_hub
from core.search.finalists import FIRST, choose, finalists
from core.search.orchestration import resume, run
from core.search.trials import Trials
from core.store.reader import StoredRun
from plugins.conformance.evaluations import tried_once
from tests.executors import Inline
from tests.playing import Named


def earn(condition, candidates):
    """Earn what the candidate's plan says for this engine and layout."""
    found = []
    for candidate in candidates:
        where = condition.where
        rewards = (
            candidate.strategy_description.split(where.engine)[1].split("b")[0].split()
        )
        reward = rewards[where.layout % len(rewards)]
        if reward == "full":
            raise OSError(28, "No space left on device")
        if reward == "raise":
            raise ValueError
        found.append(Trial(where, candidate.id, "ok", float(reward)))
    return found


class Several(Fitness):
    def conditions(self):
        raise AssertionError

    def score(self, candidate, trials):
        raise AssertionError

    def finals(self):
        for layout in itertools.count():
            yield [Condition(Named(), Named(engine), layout) for engine in ("a", "b")]


def result(*designs):
    """Rewards in the search, distances, and what is earned in the trials of both engines."""
    evaluations = [
        tried_once(
            Candidate(
                None, np.full((1, 6), float(n)), 0, n, strategy_description=trials
            ),
            "ok",
            reward,
            distance,
        )
        for n, (reward, distance, trials) in enumerate(designs)
    ]
    return Result((Generation(0, tuple(evaluations)),), 1.0)


def winner(*designs, count=8):
    best, earned = choose(
        result(*designs), Several(), Trials(Inline(), play=earn), event_hub(), count
    )
    return best.candidate.agent, earned


def test_the_one_with_room_to_spare_wins_and_the_shorter_way_only_among_those_alike():
    narrow, wide, long = (
        (1.0, 0.5, "a 1 0 b 1 1"),
        (1.0, 0.7, "a 1 1 b 1 1"),
        (1.0, 0.9, "a 1 1 b 1 1"),
    )
    assert winner(narrow, wide, long)[0] == 1
    assert winner(narrow, long, wide)[0] == 2
    assert winner(narrow, wide, count=0) == (0, {})
    assert result(narrow, wide).best.candidate.agent == 0


def test_the_engine_counts_where_the_mean_is_the_lowest():
    assert winner((1.0, 0.5, "a 1 b 0.5"), (1.0, 0.7, "a 0.8 b 0.8"))[0] == 1
    assert winner((1.0, 0.5, "a raise b 1"), (1.0, 0.7, "a 0.1 b 0.1"))[0] == 1


def test_half_goes_on_until_one_is_left():
    designs = [(1.0, 0.5 + n / 100, f"a {n / 10} b {n / 10}") for n in range(8)]
    best, earned = winner(*designs)
    assert best == 7
    counts = sorted(len(engines["a"]) for engines in earned.values())
    assert counts == [FIRST] * 4 + [2 * FIRST] * 2 + [4 * FIRST] * 2


def test_only_those_within_the_tie_are_tried_and_equal_designs_once():
    first, second, worse = (
        (1.0, 0.5, "a 0 b 0"),
        (0.996, 0.7, "a 1 b 1"),
        (0.9, 0.1, "a 1 b 1"),
    )
    assert winner(first, second, worse)[0] == 1
    assert [e.candidate.agent for e in finalists(result(first, second, worse))] == [
        0,
        1,
    ]
    assert finalists(result((0.0, 0.5, ""), (0.0, 0.6, ""))) == []
    assert winner((0.0, 0.5, "a 1 b 1"), (0.0, 0.6, "a 1 b 1")) == (0, {})


def test_a_machine_at_fault_is_named():
    with pytest.raises(UserError, match=r"can't be tried: .*fault of the machine"):
        winner((1.0, 0.5, "a full b 1"), (1.0, 0.6, "a 1 b 1"))


class Hears:
    def __init__(self, until=1000):
        self.heard, self.until = [], until

    @hookimpl(trylast=True)
    def finalist_tried(self, evaluation):
        self.heard.append(evaluation)
        if len(self.heard) == self.until:
            raise KeyboardInterrupt


def listening(until=1000):
    hub, hears = event_hub(), Hears(until)
    hub.register(hears)
    return hub, hears


def test_listeners_hear_of_each_round_and_what_was_tried_is_not_tried_again():
    designs = [(1, 1, "a 0.5 1 b 1"), (1, 2, "a 1 b 1"), (1, 3, "a 1 b 0.7")]
    hub, hears = listening()
    stored = {}
    found = result(*designs)
    winner, finals = choose(
        found, Several(), Trials(Inline(), stored.__setitem__, play=earn), hub, 8
    )
    assert {e.candidate.id: len(e.finals) for e in hears.heard} == {
        name: sum(map(len, engines.values())) for name, engines in finals.items()
    }
    kept = dict(list(stored.items())[:7])
    tried = {}
    again = choose(
        found,
        Several(),
        Trials(Inline(), tried.__setitem__, kept, play=earn),
        event_hub(),
        8,
    )
    assert (again[0].candidate.id, again[1]) == (winner.candidate.id, finals)
    assert len(tried) == len(stored) - 7


WORDS = [
    "task.variation=near",
    "sim=mujoco",
    "fitness=layouts",
    "fitness.layouts=1",
    "fitness.unseen=0",
]
WORDS += [
    "budget.n_final=2",
    "budget.n_agent=1",
    "budget.n_tool=1",
    "budget.n_action=3",
    "budget.n_iteration=0",
]
WORDS += ["evolution.tie=1", "film=false", "listener=[]", "prompt.picture=false"]


@pytest.mark.slow
@pytest.mark.usefixtures("inline")
def test_an_interrupted_run_keeps_the_trials_of_its_finalists(tmp_path, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr("core.search.setup.event_hub", lambda: listening(3)[0])
        with pytest.raises(KeyboardInterrupt):
            run(load("config", WORDS), tmp_path / "run")
    stored = [e.finals for e in StoredRun(tmp_path / "run").evaluations()]
    assert sum(map(len, stored)) == 3 * FIRST
    resume(tmp_path / "run")
    run(load("config", WORDS), tmp_path / "whole")
    one, other = (
        json.loads((tmp_path / name / "result.json").read_text())
        for name in ("run", "whole")
    )
    assert one["finalists"] == other["finalists"] != {}
    assert (one["best"], one["rollouts"]) == (other["best"], other["rollouts"])

"""Of candidates that earn alike, more trials choose the winner."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.config.compose import load
from core.design import Candidate
from core.errors import UserError
from core.events import Generation, Result
from core.hooks import hookimpl
from core.interfaces import Condition, Fitness, Trial
from core.plugins import event_hub
from core.search.finalists import MOST, WIDTH, choose, finalists
from core.search.orchestration import resume, run
from core.search.trials import Trials
from core.store.reader import StoredRun
from core.trial import TIE
from core.values.efforts import Held
from core.values.margins import Margin
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


def race(*designs, rollouts=480):
    trials = Trials(Inline(), play=earn)
    return choose(result(*designs), Several(), trials, event_hub(), rollouts)


def winner(*designs, rollouts=480):
    return race(*designs, rollouts=rollouts).winner.candidate.agent


def fails_in(*layouts, of=64):
    """A plan that earns nothing in some layouts of each ``of``."""
    rewards = " ".join("0" if n in layouts else "1" for n in range(of))
    return f"a {rewards} b {rewards}"


def test_the_one_that_holds_wins_and_the_shorter_way_only_among_those_alike():
    narrow = (1.0, 0.5, fails_in(60))
    wide = (1.0, 0.7, fails_in())
    longer = (1.0, 0.9, fails_in())
    assert winner(narrow, wide, longer) == 1
    assert winner(narrow, longer, wide) == 2
    assert winner(narrow, wide, rollouts=0) == 0
    assert result(narrow, wide).best.candidate.agent == 0


def test_of_27_that_fail_in_the_same_layouts_the_one_that_holds_is_found():
    designs = [(1.0, 0.5 + n / 100, fails_in(9, 20, 41, 63)) for n in range(27)]
    designs[19] = (1.0, 0.9, fails_in())
    choice = race(*designs)
    assert choice.winner.candidate.agent == 19
    assert choice.held.held == choice.held.layouts > 0
    tried = {name: len(engines["a"]) for name, engines in choice.finals.items()}
    del tried[choice.winner.candidate.id]
    assert sum(tried.values()) < 2 * 27


@given(st.integers(0, 1000), st.integers(2, 8))
@settings(max_examples=30, deadline=None)
def test_with_time_enough_nobody_is_better_in_the_layouts_of_the_choice(seed, count):
    rng = np.random.default_rng(seed)
    share = rng.uniform(0, 0.3, (count, 1))
    rewards = np.where(rng.random((count, MOST)) < share, 0.0, 1.0)
    designs = []
    for n, row in enumerate(rewards):
        text = " ".join(f"{reward:g}" for reward in row)
        designs.append((1.0, 0.5 + n / 100, f"a {text} b {text}"))
    best = rewards[winner(*designs, rollouts=8000)]
    assert best.mean() >= rewards.mean(axis=1).max() - TIE


def test_the_engine_counts_where_most_is_lost():
    assert winner((1.0, 0.5, "a 1 b 0.5"), (1.0, 0.7, "a 0.8 b 0.8")) == 1
    assert winner((1.0, 0.5, "a raise b 1"), (1.0, 0.7, "a 0.1 b 0.1")) == 1


def test_more_room_to_spare_goes_before_a_shorter_way():
    found = result((1.0, 0.5, fails_in()), (1.0, 0.7, fails_in()))
    first, second = found.ranking
    margins = (Margin("clearance", 0.02, 0.04, "m", 0.5),)
    roomy = replace(second, trials=(replace(second.trials[0], margins=margins),))
    found = Result((Generation(0, (first, roomy)),), 1.0)
    assert [e.candidate.agent for e in finalists(found)] == [1, 0]


def test_the_budget_is_counted_in_rollouts():
    choice = race((1.0, 0.5, fails_in()), (1.0, 0.6, fails_in(1)), rollouts=80)
    rollouts = sum(
        len(rewards)
        for engines in choice.finals.values()
        for rewards in engines.values()
    )
    assert 80 <= rollouts < 80 + 2 * WIDTH


def test_a_single_one_is_tried_to_say_how_well_it_holds():
    choice = race((1.0, 0.5, fails_in(3)), rollouts=8000)
    assert (choice.held.held, choice.held.layouts) == (MOST - 4, MOST)
    assert race((1.0, 0.5, fails_in()), rollouts=8000).held == Held(MOST, MOST)


def test_only_those_within_the_tie_are_tried_and_equal_designs_once():
    first = (1.0, 0.5, "a 0 b 0")
    second = (0.996, 0.7, "a 1 b 1")
    worse = (0.9, 0.1, "a 1 b 1")
    assert winner(first, second, worse) == 1
    assert [e.candidate.agent for e in finalists(result(first, second, worse))] == [
        0,
        1,
    ]
    nothing = result((0.0, 0.5, "a 1 b 1"), (0.0, 0.6, "a 1 b 1"))
    assert finalists(nothing) == []
    assert race((0.0, 0.5, "a 1 b 1"), (0.0, 0.6, "a 1 b 1")).finals == {}


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
    trials = Trials(Inline(), stored.__setitem__, play=earn)
    choice = choose(found, Several(), trials, hub, 40)
    heard = {e.candidate.id: len(e.finals) for e in hears.heard}
    assert heard == {
        name: sum(map(len, engines.values())) for name, engines in choice.finals.items()
    }

    kept = dict(list(stored.items())[:7])
    tried = {}
    trials = Trials(Inline(), tried.__setitem__, kept, play=earn)
    again = choose(found, Several(), trials, event_hub(), 40)
    assert again.winner.candidate.id == choice.winner.candidate.id
    assert (again.finals, again.held) == (choice.finals, choice.held)
    assert len(tried) == len(stored) - 7


WORDS = [
    "task.variation=near",
    "sim=mujoco",
    "fitness=layouts",
    "fitness.layouts=1",
    "fitness.unseen=0",
]
WORDS += [
    "budget.final_s=4",
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
    assert sum(map(len, stored)) == 3 * WIDTH
    resume(tmp_path / "run")
    run(load("config", WORDS), tmp_path / "whole")
    one, other = (
        json.loads((tmp_path / name / "result.json").read_text())
        for name in ("run", "whole")
    )
    assert one["finalists"] == other["finalists"] != {}
    assert (one["best"], one["rollouts"]) == (other["best"], other["rollouts"])

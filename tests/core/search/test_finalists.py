"""Of candidates that earn alike, more trials choose the winner."""

import contextlib
import itertools
import json
import statistics
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
from core.interfaces import Condition, Fitness, Score, Trial
from core.plugins import event_hub
from core.search.finalists import (
    FIRST,
    MOST,
    WIDTH,
    Race,
    evaluate_in_race,
)
from core.search.orchestration import resume, run
from core.search.trials import Trials
from core.store.reader import StoredRun
from core.trial import TIE, Tally, best_first, rewards_by_engine
from core.values.efforts import Held
from core.values.margins import Margin
from plugins.conformance.evaluations import tried_once
from tests.support.executors import Inline
from tests.support.playing import Named


def earn(condition, candidates):
    """Earn what the candidate's plan says for this engine and layout."""
    found = []
    for candidate in candidates:
        where = condition.where
        rewards = (
            candidate.design_description.split(where.engine)[1].split("b")[0].split()
        )
        reward = rewards[where.layout % len(rewards)]
        if reward == "full":
            raise OSError(28, "No space left on device")
        if reward == "raise":
            raise ValueError
        earned = float(reward)
        found.append(Trial(where, candidate.id, reward=earned, solved=earned >= 0.95))
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
            Candidate(None, np.full((1, 6), float(n)), 0, n, design_description=trials),
            "ok",
            reward,
            distance,
        )
        for n, (reward, distance, trials) in enumerate(designs)
    ]
    return Result((Generation(0, tuple(evaluations)),), 1.0)


def finals(trials=None, **more):
    trials = trials or Trials(Inline(), play=earn)
    fitness = Several()
    return Race(fitness.finals(), fitness, trials, TIE, **more)


def race(*designs, rollouts=480):
    return finals().choose(result(*designs), rollouts)


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


@pytest.mark.parametrize("narrow", [fails_in(5), fails_in(12)])
def test_where_there_are_few_further_layouts_the_shortest_way_that_holds_in_all_wins(
    narrow,
):
    fitness = Several()
    designs = [(1.0, 0.5, narrow), (1.0, 0.9, fails_in()), (1.0, 0.7, fails_in())]
    few = itertools.islice(fitness.finals(), 16)
    choice = Race(few, fitness, Trials(Inline(), play=earn), TIE).choose(
        result(*designs), 480
    )
    assert choice.winner.candidate.agent == 2
    assert choice.winner.finals.count_held().held == 16
    longer = choice.finals[result(*designs).ranking[2].candidate.id]
    assert len(longer["a"]) == 1, "where the narrow one failed, and nowhere else"


@pytest.mark.parametrize(("least", "won"), [("0.86", 0), ("0.85", 1)])
def test_where_finals_only_check_nineteen_twentieths_of_the_highest_are_enough(
    least, won
):
    fitness = Several()
    fitness.finals_check = True
    rewards = " ".join(["0.89", least])
    shorter = (0.9, 0.5, f"a {rewards} b {rewards}")
    longer = (0.9, 0.7, "a 0.9 b 0.9")
    few = itertools.islice(fitness.finals(), 16)
    choice = Race(few, fitness, Trials(Inline(), play=earn), TIE).choose(
        result(shorter, longer), 480
    )
    assert choice.winner.candidate.agent == won
    assert len(choice.finals) == 1 + won


def test_of_27_that_fail_in_the_same_layouts_the_one_that_holds_is_found():
    designs = [(1.0, 0.5 + n / 100, fails_in(9, 20, 41, 63)) for n in range(27)]
    designs[19] = (1.0, 0.9, fails_in())
    choice = race(*designs)
    assert choice.winner.candidate.agent == 19
    assert choice.held.held == choice.held.layouts > 0
    tried = {name: len(engines["a"]) for name, engines in choice.finals.items()}
    del tried[choice.winner.candidate.id]
    assert sum(tried.values()) < 2 * 27


@pytest.mark.thorough
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


@pytest.mark.parametrize(
    ("room", "fails", "won"),
    [(0.5, (), 1), (0.11, (), 0), (0.5, (3,), 0)],
)
def test_of_those_that_hold_the_one_with_more_room_wins_then_the_shorter_way(
    room, fails, won
):
    """A little more room decides nothing, and what holds in fewer layouts does not win by its room."""
    found = result((1.0, 0.5, fails_in()), (1.0, 0.7, fails_in(*fails)))
    rooms = zip(found.ranking, (0.1, room), strict=True)
    both = [with_room(evaluation, share) for evaluation, share in rooms]
    found = Result((Generation(0, tuple(both)),), 1.0)
    assert finals().choose(found, 480).winner is both[won]


def with_room(evaluation, share):
    margins = (Margin("clearance", share, 1.0, "m", share),)
    (trial,) = evaluation.trials
    return replace(evaluation, trials=(replace(trial, margins=margins),))


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


def test_only_those_within_the_tie_of_the_highest_reward_are_tried():
    first = (1.0, 0.5, "a 0 b 0")
    second = (0.996, 0.7, "a 1 b 1")
    behind = (0.9, 0.1, "a 1 b 1")
    choice = race(first, second, behind)
    assert choice.winner.candidate.agent == 1
    assert set(choice.finals) == {"g0-a0-s0-p0", "g0-a1-s0-p0"}
    assert winner(first, behind) == 0


def test_equal_designs_are_tried_once_and_those_that_earn_nothing_never():
    found = result((1.0, 0.5, "a 1 b 1"), (1.0, 0.5, "a 1 b 1"))
    one, other = found.ranking
    same = replace(other, candidate=replace(other.candidate, plan=one.candidate.plan))
    found = Result((Generation(0, (one, same)),), 1.0)
    assert set(finals().choose(found, 480).finals) == {one.candidate.id}
    assert race((0.0, 0.5, "a 1 b 1"), (0.0, 0.6, "a 1 b 1")).finals == {}


def test_elites_are_those_that_hold_and_an_earlier_one_stays():
    """After a generation they are tried within a budget, and what is known of earlier ones counts on."""
    earlier = result((1.0, 0.9, fails_in()), (1.0, 0.5, fails_in(0, 1))).ranking
    contest = finals()
    budget = 2 * FIRST + 2 * WIDTH
    contest.compare(earlier, budget, FIRST)
    assert [e.candidate.agent for e in best_first(earlier)] == [0, 1]
    kept = best_first(earlier)[0].finals.count_held()
    assert (kept.held, kept.layouts) == (FIRST, FIRST)

    new = result(*[(0.5, 0.1, fails_in())] * 2, (1.0, 0.1, fails_in(3))).ranking
    contest.compare(best_first([*earlier, *new]), budget, FIRST)
    assert best_first([*earlier, *new])[0].candidate.agent == 0
    assert kept == best_first(earlier)[0].finals.count_held()


def test_rollouts_of_elites_stay_within_their_budget():
    designs = [(1.0, n, fails_in(n, n + 1)) for n in range(20)]
    tried = []
    trials = Trials(Inline(), lambda key, trial: tried.append(key), play=earn)
    finals(trials).compare(result(*designs).ranking, 80, FIRST)
    assert 80 <= len(tried) < 80 + 2 * WIDTH


class Search(Several):
    """Five layouts in two engines, of which the mean counts."""

    races = True

    def conditions(self):
        return [
            Condition(Named(), Named(engine), layout)
            for engine in ("a", "b")
            for layout in range(5)
        ]

    def score(self, candidate, trials):
        return Score(min(map(statistics.mean, rewards_by_engine(trials).values())))


def evaluate(*designs, best=0.0, order=None):
    trials = Trials(Inline(order), play=earn)
    candidates = [e.candidate for e in result(*designs).generations[0].evaluations]
    found = list(evaluate_in_race(candidates, Search(), trials, TIE, best))
    return {evaluation.candidate.agent: evaluation for evaluation in found}


def test_in_the_search_those_clearly_behind_are_not_tried_in_the_layouts_left():
    designs = [(0, 0, "a 1 b 1"), (0, 0, "a 1 b 0.998"), (0, 0, "a 0.5 b 1")]
    designs += [(0, 0, f"a {n / 100} b 1") for n in range(30)]
    found = evaluate(*designs)
    assert [len(found[n].trials) for n in (0, 1, 3)] == [10, 10, 2]
    assert found[3].reward == 0
    assert found[3].warnings == (
        "tried in 1 of 5 layouts: too far behind to be the best",
    )
    assert sum(len(e.trials) for e in found.values()) < 33 * 10 / 2


def test_who_is_behind_an_earlier_generation_is_left_out_too():
    found = evaluate((0, 0, "a 0.9 b 0.9"), (0, 0, "a 0.8 b 0.8"), best=1.0)
    assert [len(found[n].trials) for n in range(2)] == [2, 2]


@given(st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_nobody_who_is_left_out_could_have_been_the_best(seed):
    rng = np.random.default_rng(seed)
    rewards = np.round(rng.random((12, 2, 5)) ** rng.choice([0.1, 0.5, 1]), 3)
    designs = []
    for mine in rewards:
        one, other = (" ".join(f"{reward:g}" for reward in row) for row in mine)
        designs.append((0, 0, f"a {one} b {other}"))
    found = evaluate(*designs)
    means = rewards.mean(axis=2).min(axis=1)
    for number, evaluation in found.items():
        if len(evaluation.trials) == 10:
            assert evaluation.reward == pytest.approx(means[number])
        else:
            assert means[number] < means.max() - TIE
            assert evaluation.reward < means.max() - TIE
    again = evaluate(*designs, order=np.random.default_rng(seed))
    for number, evaluation in again.items():
        assert str(evaluation.trials) == str(found[number].trials)  # nan is not nan


def test_a_machine_at_fault_is_named():
    with pytest.raises(UserError, match=r"can't be tried: .*fault of the machine"):
        winner((1.0, 0.5, "a full b 1"), (1.0, 0.6, "a 1 b 1"))


class Impatient:
    """Interrupts the run when the third finalist was tried."""

    left = 3

    @hookimpl(trylast=True)
    def finalist_tried(self, evaluation):
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


def impatient_hub():
    hub = event_hub()
    hub.register(Impatient())
    return hub


def test_listeners_hear_of_each_round_and_what_was_tried_is_not_tried_again():
    designs = [(1, 1, "a 0.5 1 b 1"), (1, 2, "a 1 b 1"), (1, 3, "a 1 b 0.7")]
    heard = {}
    stored = {}
    found = result(*designs)
    trials = Trials(Inline(), stored.__setitem__, play=earn)

    def hear(runner):
        heard[runner.candidate.id] = len(runner.finals.in_order())

    choice = finals(trials, tell=hear).choose(found, 40)
    assert heard == {
        name: sum(map(len, engines.values())) for name, engines in choice.finals.items()
    }

    kept = dict(list(stored.items())[:7])
    tried = {}
    trials = Trials(Inline(), tried.__setitem__, kept, play=earn)
    again = finals(trials).choose(result(*designs), 40)
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
    "budget=tiny",
    "budget.final_s=4",
    "budget.n_action=3",
]
WORDS += ["evolution.tie=1", "film=false", "listener=[]", "prompt.picture=false"]


@pytest.mark.thorough
@pytest.mark.usefixtures("inline")
@pytest.mark.parametrize("elites", [0, 2])
def test_a_run_interrupted_among_elites_or_finalists_keeps_their_trials(
    elites, tmp_path, monkeypatch
):
    words = [*WORDS, f"budget.elite_s={elites}"]
    with monkeypatch.context() as patched:
        patched.setattr("core.search.setup.event_hub", impatient_hub)
        with contextlib.suppress(KeyboardInterrupt):  # in the loop it is noted
            run(load("config", words), tmp_path / "run")
    stored = [e.finals for e in StoredRun(tmp_path / "run").evaluations()]
    # The others are tried where the first lost something.
    first, *others = map(Tally.of_trials, stored)
    assert first.count == WIDTH
    lost = [number for number in first.losses if first.loss_in([number])]
    assert lost
    assert [sorted(other.losses) for other in others] == [sorted(lost)] * 2
    resume(tmp_path / "run")
    run(load("config", words), tmp_path / "whole")
    one, other = (
        json.loads((tmp_path / name / "result.json").read_text())
        for name in ("run", "whole")
    )
    for key in ("finalists", "held", "perturbed", "best", "rollouts"):
        assert one[key] == other[key] != {}


@pytest.mark.parametrize("seed", range(5))
def test_the_order_in_which_trials_end_decides_nothing(seed):
    designs = [(1.0 - n / 4000, n, fails_in(n, 2 * n)) for n in range(12)]
    shuffled = Trials(Inline(np.random.default_rng(seed)), play=earn)
    choice = finals(shuffled).choose(result(*designs), 300)
    expected = race(*designs, rollouts=300)
    assert choice.winner.candidate.id == expected.winner.candidate.id
    assert (choice.finals, choice.held) == (expected.finals, expected.held)


def tally(held, count):
    """What came of a candidate in so many further layouts, of which it held in some."""
    losses = {number: {"a": float(number >= held)} for number in range(count)}
    return Tally({}, losses)


def ranks(*designs):
    """Rank designs of a reward in the search, and of further layouts held and tried; return their numbers."""
    tried = []
    for number, (reward, held, count) in enumerate(designs):
        candidate = Candidate(None, np.full((1, 6), float(number)), 0, number)
        found = tried_once(candidate, "ok", reward, 0.5)
        tried.append(replace(found, finals=tally(held, count)))
    return [evaluation.candidate.agent for evaluation in best_first(tried)]


def test_what_is_known_of_more_layouts_counts_for_more():
    assert ranks((0.985, 0, 0), (1.0, 7, 10)) == [1, 0]
    assert ranks((1.0, 2, 8), (1.0, 21, 24)) == [1, 0]
    assert ranks((1.0, 3, 3), (1.0, 60, 64)) == [1, 0]
    assert ranks((1.0, 64, 64), (1.0, 63, 64)) == [0, 1]


def test_of_the_leading_two_layouts_decide_that_neither_was_tried_in():
    fails_later = (1.0, 0.4, fails_in(*range(20, 400, 2), of=400))
    holds_later = (1.0, 0.5, fails_in(of=400))
    leader, other = result(fails_later, holds_later).ranking
    runners = finals()
    runners.draw(20)
    leader = replace(leader, finals=tally(19, 20))
    other = replace(other, finals=tally(7, 8))
    assert best_first([leader, other])[0] is leader

    assert runners.decide([leader, other], limit=64) is other
    assert runners.spent == 64


def test_the_finals_keep_to_their_budget():
    designs = [(1.0, 0.5 + n / 100, fails_in(n, n + 9, n + 30)) for n in range(12)]
    for rollouts in (100, 480):
        runners = finals()
        runners.choose(result(*designs), rollouts)
        assert runners.spent <= rollouts + 4 * WIDTH

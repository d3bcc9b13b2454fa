"""Candidates that stop early: the reward that is certain, what is said of it, and who wins."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.design import Candidate, Evaluation, Tool, Trial, best_first
from core.errors import UsageError
from plugins.fitness.layouts import COMBINE
from plugins.fitness.racing import SeveralTrials, Stops, lead
from tests.executors import Inline


def candidates(count):
    return [Candidate(Tool(), np.zeros((1, 6)), action=number) for number in range(count)]


def table(rewards, calls=None):
    """Evaluators for rewards by engine, trial and candidate; ``calls`` notes how many candidates each got."""

    def evaluator(of):
        def evaluate(chunk):
            if calls is not None:
                calls.append(len(chunk))
            return [Evaluation(c, "ok", of[c.action], distance_m=1.0) for c in chunk]

        return evaluate

    return {engine: [evaluator(of) for of in trials] for engine, trials in rewards.items()}


def staged(rewards, combine="mean", calls=None, **stops):
    count = len(next(iter(rewards.values()))[0])
    return SeveralTrials(table(rewards, calls), COMBINE[combine][0], Stops(**stops), "layout")(candidates(count))


def test_it_stops_as_soon_as_it_cannot_exceed_the_threshold():
    calls = []
    good, poor = staged({"a": [[1.0, 0.1], [1.0, 0.0], [1.0, 0.9], [0.0, 1.0]]}, calls=calls, below=0.6)
    assert calls == [2, 2, 1, 1]
    assert (good.reward, good.stopped, good.warnings) == (0.75, False, ())
    assert (good.unneeded, good.saved_s) == (0, 0.0)
    assert poor.reward == pytest.approx(0.1 / 4)
    assert (len(poor.trials), poor.planned, poor.unneeded) == (2, 4, 2)
    assert poor.warnings == (
        "stopped after 2 of 4 layouts: it can't earn more than 0.525 any more, and fitness.stop_below is 0.6",
    )


def test_an_engine_that_it_does_not_come_to_counts_nothing():
    (found,) = staged({"a": [[0.2], [0.4]], "b": [[1.0], [1.0]]}, below=0.3)
    assert (found.reward, len(found.trials), found.planned) == (0.0, 2, 4)
    assert list(found.by_engine) == ["a"]


REWARDS = st.lists(st.lists(st.floats(0, 1), min_size=4, max_size=4), min_size=1, max_size=4)


@given(one=REWARDS, other=REWARDS, below=st.floats(0, 0.99), combine=st.sampled_from(list(COMBINE)))
def test_the_threshold_changes_nothing_of_what_exceeds_it(one, other, below, combine):
    rewards = {"a": one, "b": other}
    full, found = staged(rewards, combine), staged(rewards, combine, below=below)
    for whole, part in zip(full, found, strict=True):
        if part.stopped:
            assert part.reward <= whole.reward <= below + 1e-6
        else:
            assert (part.reward, part.by_engine) == (whole.reward, whole.by_engine)
    best = best_first(full)[0]
    if best_first(full, tie=0.0)[0].reward - 0.005 > below:
        assert best_first(found)[0].candidate.id == best.candidate.id
    kinds = [e.stopped for e in best_first(found)]
    assert kinds == sorted(kinds)  # none that stopped comes before one that did not


def test_no_candidates_and_all_stopped():
    assert SeveralTrials(table({"a": [[]]}), np.mean, Stops(), "layout")([]) == []
    calls = []
    assert all(e.stopped for e in staged({"a": [[0.0, 0.0], [1.0, 1.0]]}, calls=calls, below=0.5))
    assert calls == [2]


def raced(rewards, chunks, combine="mean", earlier=(), order=None, calls=None, **stops):
    """Race ``chunks`` of numbers of candidates; results arrive in a random ``order``."""
    many = candidates(sum(map(len, chunks)))
    fitness, found = SeveralTrials(table(rewards, calls), COMBINE[combine][0], Stops(**stops), "layout"), {}
    numbered = [[many[number] for number in chunk] for chunk in chunks]
    executor = Inline(order)
    for chunk, result in fitness.race(numbered, executor, lambda: earlier) or executor.map(fitness, numbered):
        if isinstance(result, Exception):
            found |= {c.action: result for c in chunk}
        else:
            assert [e.candidate for e in result] == chunk
            found |= {e.candidate.action: e for e in result}
    return [found[number] for number in range(len(many))]


def test_in_a_race_it_stops_as_soon_as_it_is_clearly_behind():
    calls = []
    rewards = {"a": [[0.9, 0.3, 0.65, 0.9], [0.8, 1.0, 0.35, 0.8], [1.0, 1.0, 1.0, 0.0]]}
    found = raced(rewards, [[0, 1], [2, 3]], calls=calls, behind=1.5)
    assert [e.stopped for e in found] == [False, True, True, False]
    assert calls == [2, 2, 1, 2, 1, 1]
    assert found[1].warnings == (
        "stopped after 1 of 3 layouts: it earned 0.3 on average, and the best one 0.9: 3 standard errors more; "
        "fitness.stop_behind is 1.5",
    )
    assert (found[2].reward, len(found[2].trials), found[2].planned) == (pytest.approx(1 / 3), 2, 3)
    assert [found[n].reward for n in (0, 3)] == pytest.approx([0.9, 1.7 / 3])
    assert found[1].unneeded == 2


def test_a_lead_counts_by_how_even_it_is():
    assert lead([0.8], [0.5]) == pytest.approx(1.5)
    assert lead([0.8, 0.8], [0.5, 0.5]) == pytest.approx(3.0)
    assert lead([0.9, 0.7], [0.5, 0.5]) == pytest.approx(0.3 / ((0.04 + 0.02) ** 0.5 / 2))
    assert lead([1.0, 0.0], [0.4, 0.0]) < lead([0.7, 0.3], [0.4, 0.0])
    assert lead([0.2, 0.9], [0.9, 0.2]) == pytest.approx(0.0)


def test_a_race_is_run_against_earlier_candidates_too():
    rewards = {"a": [[0.45, 0.65], [1.0, 1.0]], "b": [[1.0, 1.0], [1.0, 1.0]]}
    (champion,) = raced({"a": [[0.9], [1.0]], "b": [[1.0], [0.2]]}, [[0]], behind=1.5)
    assert [e.stopped for e in raced(rewards, [[0], [1]], behind=1.5)] == [False, False]
    first, second = raced(rewards, [[0], [1]], earlier=[champion], behind=1.5)
    assert (first.stopped, second.stopped) == (True, False)
    short = replace(champion, trials=(Trial("a", reward=0.9),))  # has no second trial to compare with
    assert [e.stopped for e in raced(rewards, [[0], [1]], earlier=[short, first], behind=1.5)] == [True, False]


@given(
    rewards=st.lists(st.lists(st.floats(0, 1), min_size=6, max_size=6), min_size=1, max_size=4),
    behind=st.floats(0.1, 5),
    below=st.none() | st.floats(0, 0.99),
    combine=st.sampled_from(list(COMBINE)),
    seed=st.integers(0, 99),
    known=st.sets(st.integers(0, 5)),
)
def test_a_race_ends_the_same_way_in_any_order_and_when_it_is_resumed(rewards, behind, below, combine, seed, known):
    table_of = {"a": rewards[:2], "b": rewards[2:]} if len(rewards) > 2 else {"a": rewards}
    stops = {"behind": behind, "below": below}
    found = raced(table_of, [[0, 1], [2, 3, 4], [5]], combine, **stops)
    same = raced(table_of, [[5], [0, 1], [2], [3, 4]], combine, order=np.random.default_rng(seed), **stops)
    whole = raced(table_of, [[0, 1, 2, 3, 4, 5]], combine)
    left = [number for number in range(6) if number not in known]
    part_of = {engine: [[of[n] for n in left] for of in trials] for engine, trials in table_of.items()}
    stored = [found[number] for number in known]
    again = raced(part_of, [list(range(len(left)))], combine, earlier=stored, **stops) if left else []

    def said(evaluations):
        return [(e.reward, e.planned, e.warnings) for e in evaluations]

    assert said(found) == said(same)
    assert said(again) == said([found[number] for number in left])
    for one, full in zip(found, whole, strict=True):
        assert one.stopped or one.reward == full.reward
    assert below is not None or not all(e.stopped for e in found)


def test_a_chunk_that_fails_leaves_the_race_alone():
    def broken(chunk):
        raise ValueError(f"lost {len(chunk)}")

    many = candidates(3)
    first = table({"a": [[0.9, 0.9, 0.1]]})["a"][0]
    evaluators = {"a": [first, lambda chunk: broken(chunk) if many[1] in chunk else first(chunk)]}
    fitness = SeveralTrials(evaluators, np.mean, Stops(behind=0.5), "layout")
    found = list(fitness.race([[many[0]], many[1:]], Inline(), tuple))
    assert [(chunk, str(result)) for chunk, result in found if isinstance(result, Exception)] == [([many[1]], "lost 1")]
    assert [chunk for chunk, result in found if not isinstance(result, Exception)] == [[many[2]], [many[0]]]


def test_what_was_rejected_goes_on_since_it_may_fit_another_layout():
    def rejected(chunk):
        return [Evaluation(c, "rejected", reason="it overlaps") for c in chunk]

    evaluators = table({"a": [[1.0, 1.0], [1.0, 1.0]]})
    evaluators["a"].insert(0, rejected)
    better = replace(raced({"a": [[0.9], [0.9], [0.9]]}, [[0]])[0], candidate=replace(candidates(1)[0], agent=1))
    fitness = SeveralTrials(evaluators, np.mean, Stops(behind=0.25), "change")
    ((_, evaluations),) = fitness.race([candidates(2)], Inline(), lambda: [better])
    assert [(len(e.trials), e.planned) for e in evaluations] == [(2, 3)] * 2


@pytest.mark.parametrize("behind", [0.0, -1.0, float("nan"), float("inf")])
@pytest.mark.parametrize("below", [1.0, -0.1, float("nan")])
def test_a_wrong_threshold_or_lead_is_reported(below, behind):
    with pytest.raises(UsageError, match=r"fitness.stop_below must be null, or from 0 to below 1, got"):
        Stops(below=below)
    with pytest.raises(UsageError, match=r"fitness.stop_behind must be null, or above 0, got"):
        Stops(behind=behind)


def test_the_prompt_says_when_a_plan_is_given_up():
    assert Stops().instructions() == ""
    said = Stops(0.5, 0.25).instructions()
    assert "as soon as it can't earn more than 0.5 any more, or as soon as it is clearly behind" in said

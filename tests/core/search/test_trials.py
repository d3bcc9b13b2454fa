"""The scheduler of trials: what is dealt to workers, what is shared, and when a trial counts as known."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from core.design import Candidate, Component, Tool
from core.errors import Fault, UserError
from core.geometry import Box, Pose
from core.interfaces import Condition, Fitness, RolloutSettings, Score, Trial
from core.search.trials import Trials, key_of
from core.values.plans import Waypoints
from plugins.multitask.joined_plans import TaskPlans
from tests.support.executors import Inline
from tests.support.faults import Crowded, Faulty
from tests.support.faults import candidate as rod
from tests.support.playing import Named, condition


def tool(name="rod"):
    return Tool((Component(name, "tool_mount", Pose(), Box((0.1, 0.1, 0.1))),))


def plan(number):
    return Waypoints(np.full((1, 6), float(number)))


def candidates(*plans, agent=0, own=None):
    """Candidates of one tool with plans of these numbers."""
    own = own or tool()
    return [
        Candidate(own, plan(number), 0, agent, 0, action)
        for action, number in enumerate(plans)
    ]


def conditions(*layouts, task="task", **settings):
    return [
        Condition(Named(task), Named("engine"), layout, **settings)
        for layout in layouts
    ]


class Layouts(Fitness):
    """The mean over conditions."""

    def __init__(self, *where):
        self.where = where

    def conditions(self):
        return self.where

    def score(self, candidate, trials):
        return Score(float(np.mean([trial.reward for trial in trials])))


class Diary:
    """What happens, in order: chunks that are played, trials that are told."""

    def __init__(self, breaks=lambda condition, candidates: None):
        self.entries = []
        self.breaks = breaks

    def play(self, where, candidates):
        self.entries.append(("play", where.layout, [c.id for c in candidates]))
        error = self.breaks(where, candidates)
        if error is not None:
            raise error
        return [Trial(where.where, c.id, "ok", where.layout / 10) for c in candidates]

    def tell(self, key, trial):
        self.entries.append(("tell", trial.layout, trial.candidate))

    def trials(self, executor=None, **known):
        return Trials(executor or Inline(), self.tell, play=self.play, **known)

    @property
    def played(self):
        return [entry[1:] for entry in self.entries if entry[0] == "play"]


# --- chunks -----------------------------------------------------------------------------------------------------


def test_layouts_of_one_candidate_are_chunks_of_their_own():
    diary = Diary()
    (evaluation,) = diary.trials().evaluate(
        candidates(1), Layouts(*conditions(3, 4, 5))
    )
    name = evaluation.candidate.id
    assert diary.played == [(3, [name]), (4, [name]), (5, [name])]
    assert [trial.layout for trial in evaluation.trials] == [3, 4, 5]
    assert evaluation.reward == pytest.approx(0.4)


def test_trials_are_in_the_order_of_the_conditions_however_they_end():
    for seed in range(5):
        diary = Diary()
        trials = diary.trials(Inline(np.random.default_rng(seed)))
        found = list(trials.evaluate(candidates(1, 2), Layouts(*conditions(3, 4, 5))))
        assert len(found) == 2
        assert all([trial.layout for trial in e.trials] == [3, 4, 5] for e in found)


def test_a_chunk_holds_a_tools_candidates_in_one_condition():
    diary = Diary()
    both = [*candidates(1, 2), *candidates(3, agent=1, own=tool("other"))]
    list(diary.trials().evaluate(both, Layouts(*conditions(0, 1))))
    assert diary.played == [
        (0, ["g0-a0-s0-p0", "g0-a0-s0-p1"]),
        (1, ["g0-a0-s0-p0", "g0-a0-s0-p1"]),
        (0, ["g0-a1-s0-p0"]),
        (1, ["g0-a1-s0-p0"]),
    ]


def test_an_engine_with_large_batches_is_given_several_tools_in_one_condition():
    both = [*candidates(1, 2), *candidates(3, agent=1, own=tool("other"))]
    where = [replace(each, sim=Named("engine", batch=100)) for each in conditions(0, 1)]
    diary = Diary()
    list(diary.trials().evaluate(both, Layouts(*where)))
    ids = [candidate.id for candidate in both]
    assert diary.played == [(0, ids), (1, ids)]


# --- when a trial ends ------------------------------------------------------------------------------------------


def test_a_trial_is_told_when_it_ends_and_before_its_candidate_is_complete():
    diary = Diary()
    for evaluation in diary.trials().evaluate(
        candidates(1, 2), Layouts(*conditions(0, 1))
    ):
        diary.entries.append(("complete", evaluation.candidate.id))
    first, second = "g0-a0-s0-p0", "g0-a0-s0-p1"
    assert diary.entries == [
        ("play", 0, [first, second]),
        ("tell", 0, first),
        ("tell", 0, second),
        ("play", 1, [first, second]),
        ("tell", 1, first),
        ("tell", 1, second),
        ("complete", first),
        ("complete", second),
    ]


def test_trials_that_ended_before_an_interrupt_are_told():
    def interrupted(where, candidates):
        return KeyboardInterrupt() if where.layout == 2 else None

    diary = Diary(interrupted)
    with pytest.raises(KeyboardInterrupt):
        list(diary.trials().evaluate(candidates(1), Layouts(*conditions(0, 1, 2))))
    assert [entry[1] for entry in diary.entries if entry[0] == "tell"] == [0, 1]


def test_the_key_that_is_told_is_that_of_the_candidate_in_its_condition():
    (made,), (where,), told = candidates(1), conditions(3), {}
    trials = Trials(Inline(), told.__setitem__, play=Diary().play)
    list(trials.evaluate([made], Layouts(where)))
    assert told == {key_of(made, where): trials.known[key_of(made, where)]}


# --- what is known ----------------------------------------------------------------------------------------------


def test_equal_plans_of_two_agents_share_their_trials():
    diary = Diary()
    one, same = candidates(1), candidates(1, agent=1)
    found = {
        e.candidate.agent: e
        for e in diary.trials().evaluate([*one, *same], Layouts(*conditions(0, 1)))
    }
    assert diary.played == [(0, ["g0-a0-s0-p0"]), (1, ["g0-a0-s0-p0"])]
    assert found[1].candidate is same[0]
    assert found[1].trials == found[0].trials
    assert [found[agent].rollouts for agent in (0, 1)] == [2, 0]


def test_equal_plans_in_one_chunk_are_played_once():
    diary = Diary()
    assert (
        len(list(diary.trials().evaluate(candidates(1, 2, 1), Layouts(*conditions(0)))))
        == 3
    )
    assert diary.played == [(0, ["g0-a0-s0-p0", "g0-a0-s0-p1"])]


def test_a_trial_that_is_known_is_not_tried():
    """As of a run that was killed between a candidate's layouts."""
    (made,), where = candidates(1), conditions(0, 1, 2)
    earlier = Trial(where[1].where, made.id, "ok", 0.75)
    diary = Diary()
    trials = diary.trials(known={key_of(made, where[1]): earlier})
    (evaluation,) = trials.evaluate([made], Layouts(*where))
    assert [layout for layout, _ in diary.played] == [0, 2]
    assert evaluation.trials[1] is earlier
    assert [entry[1] for entry in diary.entries if entry[0] == "tell"] == [0, 2]


def test_a_candidate_of_which_all_is_known_costs_nothing():
    diary = Diary()
    trials = diary.trials()
    first = list(trials.evaluate(candidates(1), Layouts(*conditions(0, 1))))
    diary.entries.clear()
    again = list(trials.evaluate(candidates(1, agent=3), Layouts(*conditions(1, 0))))
    assert diary.entries == []
    assert again[0].trials == first[0].trials[::-1]


def test_conditions_differ_in_task_engine_layout_and_perturbation():
    @dataclass(frozen=True)
    class Change:
        number: int

    (where,) = conditions(0)
    others = [
        replace(where, task=Named("other")),
        replace(where, sim=Named("other")),
        replace(where, engine="mujoco (thin air)"),
        replace(where, layout=1),
        replace(where, change=Change(0)),
        replace(where, change=Change(1)),
    ]
    (made,) = candidates(1)
    assert len({key_of(made, each) for each in [where, *others]}) == 7


def test_a_plan_for_one_of_several_tasks_is_known_by_itself():
    """A candidate that joins the plans of others for one tool needs no trial."""
    own = tool()
    first, second = (TaskPlans((("a", plan(n)), ("b", plan(n + 1)))) for n in (1, 3))
    joined = TaskPlans((("a", plan(1)), ("b", plan(4))))
    where = Layouts(*conditions(0, task="a"), *conditions(0, task="b"))
    diary = Diary()
    trials = diary.trials()
    list(
        trials.evaluate(
            [Candidate(own, first), Candidate(own, second, action=1)], where
        )
    )
    diary.entries.clear()
    (evaluation,) = trials.evaluate([Candidate(own, joined, action=2)], where)
    assert diary.entries == []
    assert [trial.candidate for trial in evaluation.trials] == [
        "g0-a0-s0-p0",
        "g0-a0-s0-p1",
    ]
    assert evaluation.rollouts == 0


# --- what breaks ------------------------------------------------------------------------------------------------


def test_what_breaks_a_rule_in_any_condition_has_no_trials():
    diary = Diary()
    broken = replace(candidates(1)[0], problem="it has no boxes")
    (evaluation,) = diary.trials().evaluate([broken], Layouts(*conditions(0)))
    assert (evaluation.status, evaluation.reason, evaluation.reward) == (
        "rejected",
        "it has no boxes",
        0.0,
    )
    assert evaluation.trials == ()
    assert diary.entries == []


def test_only_the_guilty_candidate_fails_and_only_in_the_layout_where_it_breaks():
    def breaks(where, chunk):
        return (
            RuntimeError("it burst")
            if where.layout == 1 and any(c.action == 2 for c in chunk)
            else None
        )

    diary = Diary(breaks)
    found = list(
        diary.trials().evaluate(candidates(1, 2, 3), Layouts(*conditions(0, 1, 2)))
    )
    statuses = {e.candidate.action: [trial.status for trial in e.trials] for e in found}
    assert statuses == {0: ["ok"] * 3, 1: ["ok"] * 3, 2: ["ok", "failed", "ok"]}
    (guilty,) = (e.trials[1] for e in found if e.candidate.action == 2)
    assert (guilty.reason, guilty.reward, guilty.layout) == (
        "RuntimeError: it burst",
        0.0,
        1,
    )
    ids = [candidate.id for candidate in candidates(1, 2, 3)]
    assert diary.played == [
        (0, ids),
        (1, ids),
        (2, ids),
        *((1, [name]) for name in ids),
    ]


def test_a_fault_of_the_machine_leaves_the_trial_untold():
    def full(where, chunk):
        return Fault("no room") if where.layout == 1 else None

    diary = Diary(full)
    with pytest.raises(
        UserError,
        match=r"candidate g0-a0-s0-p0 can't be tried: .*no room.*fault of the machine",
    ):
        list(diary.trials().evaluate(candidates(1), Layouts(*conditions(0, 1))))
    assert [entry[1] for entry in diary.entries if entry[0] == "tell"] == [0]


def test_an_executor_that_loses_a_chunk_is_told_on():
    class Losing(Inline):
        def map(self, function, chunks):
            return (
                pair
                for number, pair in enumerate(super().map(function, chunks))
                if number
            )

    with pytest.raises(UserError, match="map gave no result for 1 trials"):
        list(
            Diary().trials(Losing()).evaluate(candidates(1), Layouts(*conditions(0, 1)))
        )


def test_a_tool_that_starts_inside_something_in_one_layout_is_tried_in_the_others():
    first = condition(Crowded(), Faulty(), 0, RolloutSettings(settle_s=0, hold_s=0))
    where = [replace(first, layout=layout) for layout in range(3)]
    (evaluation,) = Trials(Inline()).evaluate([rod(0)], Layouts(*where))
    assert [trial.status for trial in evaluation.trials] == ["ok", "rejected", "ok"]
    clear, inside, also_clear = evaluation.trials
    assert "component 'rod' starts" in inside.reason
    assert clear.reward > 0
    assert evaluation.reward == pytest.approx((clear.reward + also_clear.reward) / 3)
    assert evaluation.rollouts == 2


# --- what a plugin gets wrong -----------------------------------------------------------------------------------


class Judge(Layouts):
    """Gives what it was made with, or raises it."""

    def __init__(self, given):
        super().__init__(*conditions(3))
        self.given = given

    def score(self, candidate, trials):
        if isinstance(self.given, Exception):
            raise self.given
        return self.given


@pytest.mark.parametrize("reward", [2.0, -0.1, float("nan"), float("inf"), 10**400])
def test_a_reward_of_a_fitness_that_is_none_becomes_0_with_the_reason(reward):
    (evaluation,) = Diary().trials().evaluate(candidates(1), Judge(Score(reward)))
    assert evaluation.reward == 0
    assert evaluation.reason.endswith(f".Judge: the reward {reward} is not in [0, 1]")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (None, "AttributeError: 'NoneType' object has no attribute 'reward'"),
        (0.5, "AttributeError: 'float' object has no attribute 'reward'"),
        (Score([0.5]), "TypeError: "),
        (Score(None), "TypeError: "),
        (Score(0.5, shown=1), "IndexError: "),
        (ZeroDivisionError("by\nzero"), "ZeroDivisionError: by zero"),
    ],
)
def test_a_fitness_that_gives_no_score_ends_a_run_with_its_name(given, said):
    with pytest.raises(UserError, match=rf"^[\w.]+\.Judge: score: {said}"):
        list(Diary().trials().evaluate(candidates(1), Judge(given)))


def test_an_executor_that_gives_a_result_twice_ends_a_run_with_its_name():
    class Twice(Inline):
        def map(self, function, chunks):
            for result in super().map(function, chunks):
                yield from (result, result)

    diary = Diary()
    with pytest.raises(UserError, match=r"Twice: map gave the result of a chunk twice"):
        list(diary.trials(Twice()).evaluate(candidates(1), Layouts(*conditions(3))))
    assert [entry for entry in diary.entries if entry[0] == "tell"] == [
        ("tell", 3, "g0-a0-s0-p0")
    ]

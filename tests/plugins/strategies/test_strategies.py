import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.design import Candidate, Tool
from core.errors import UserError
from core.interfaces import Budget, Score
from core.plugins import installed
from core.search.setup import build_strategy
from core.trial import TIE, Evaluation, Trial, Where
from plugins.conformance.evaluations import tried_once
from plugins.strategies.vlmgineer import select


def earned(
    reward, strategy=0, action=0, *, generation=0, agent=0, distance=1.0, status="ok"
):
    candidate = Candidate(Tool(), np.zeros((1, 6)), generation, agent, strategy, action)
    return tried_once(candidate, status, reward=reward, distance_m=distance)


class Recorder:
    """A designer that remembers what it was asked for."""

    def __init__(self):
        self.asked = []

    def design(self, generation, elites=()):
        self.asked.append((generation, [elite.candidate.id for elite in elites]))
        return iter([Candidate(Tool(), np.zeros((1, 6)), generation)])


def strategy(name, k_top=5, reward_save=0.5, k_least=0, **settings):
    designer = Recorder()
    budget = Budget(2, 2, 2, 3, k_top, reward_save, k_least=k_least)
    tie = settings.pop("tie", TIE)
    made = installed().create(
        "evolution", name, settings, designer=designer, budget=budget
    )
    made.tie = tie
    return made, designer


def choose(evaluations, k_top, reward_save, tie=TIE):
    """The elites by the paper's rule."""
    return select(evaluations, Budget(2, 2, 2, 3, k_top, reward_save, k_least=0), tie)


def rewards(evaluations):
    return [evaluation.reward for evaluation in evaluations]


# --- elites -----------------------------------------------------------------------------------------------------


def test_one_of_each_tool():
    found = choose(
        [
            earned(0.8, 0, 0),
            earned(0.9, 0, 1),
            earned(0.7, 1, 0),
            earned(0.85, 0, 0, agent=1),
        ],
        5,
        0.0,
    )
    assert [e.candidate.id for e in found] == [
        "g0-a0-s0-p1",
        "g0-a1-s0-p0",
        "g0-a0-s1-p0",
    ]


def test_one_tools_plans_crowd_out_the_others_before_they_are_thinned():
    """As in the method: first the k_top highest, then one per tool."""
    same_tool = [earned(0.9, 0, action) for action in range(3)]
    assert rewards(choose([*same_tool, earned(0.8, 1)], 3, 0.0)) == [0.9]


def test_of_several_tasks_the_best_of_each_is_an_elite_and_stays():
    earned_in = {0: (0.6, 0.5), 1: (0.0, 0.9), 2: (0.7, 0.0)}  # in two tasks
    found = []
    for number, (in_a, in_b) in earned_in.items():
        candidate = Candidate(Tool(), np.zeros((1, 6)), design=number)
        trials = tuple(
            Trial(Where(task, "", 0), reward=reward)
            for task, reward in (("a", in_a), ("b", in_b))
        )
        found.append(
            Evaluation(
                candidate, trials, Score((in_a + in_b) / 2, {"a": in_a, "b": in_b})
            )
        )
    assert [e.candidate.design for e in choose(found, 1, 0.5)] == [0, 2, 1]
    search, designer = strategy("vlmgineer", k_top=1)
    search.tell(found)
    search.tell([earned(0.0, 3)])
    search.ask()
    assert [name[-5:-3] for name in designer.asked[0][1]] == ["s0", "s2", "s1"]


def test_ties_go_to_the_shorter_way():
    found = choose(
        [earned(0.9, 0, 0, distance=2.0), earned(0.9, 0, 1, distance=1.0)], 5, 0.0
    )
    assert [e.candidate.action for e in found] == [1]


@pytest.mark.parametrize(
    ("tie", "first"), [({}, 1), ({"tie": 0.0}, 0), ({"tie": 0.1}, 2)]
)
def test_the_shorter_of_two_that_are_nearly_the_best_is_the_first_elite(tie, first):
    search, designer = strategy("vlmgineer", k_top=1, **tie)
    search.ask()
    search.tell(
        [
            earned(0.900, 0),
            earned(0.896, 1, distance=0.5),
            earned(0.85, 2, distance=0.1),
        ]
    )
    search.ask()
    assert designer.asked[-1] == (1, [f"g0-a0-s{first}-p0"])


@pytest.mark.parametrize("tie", [-0.1, math.nan, math.inf, "much"])
def test_a_tie_is_a_share_of_the_reward(tie):
    designer = Recorder()
    designer.assignment = SimpleNamespace(budget=Budget(2, 2, 2, 3, 5, 0.5))
    for settings in ({}, {"refine": 5}):
        with pytest.raises(
            UserError, match=rf"evolution\.tie: must be .*, got .?{tie}"
        ):
            build_strategy({"name": "sampling", "tie": tie, **settings}, designer)

    built = build_strategy({"name": "sampling", "tie": 0.25}, designer)
    assert built.tie == 0.25


def test_what_was_not_tried_is_no_elite():
    assert (
        choose([earned(1.0, status="rejected"), earned(1.0, status="failed")], 5, 0.0)
        == []
    )


evaluations = st.lists(
    st.builds(
        earned,
        st.floats(0, 1),
        st.integers(0, 3),
        st.integers(0, 3),
        agent=st.integers(0, 2),
    ),
    max_size=30,
)


@given(evaluations, st.integers(1, 6), st.floats(0, 1))
def test_elites(candidates, k_top, reward_save):
    found = choose(candidates, k_top, reward_save, 0.0)
    assert len(found) <= k_top
    assert all(e.reward > reward_save for e in found)
    assert len({e.candidate.key[:3] for e in found}) == len(found)
    assert rewards(found) == sorted(rewards(found), reverse=True)
    best = max(rewards(candidates), default=0)
    assert rewards(found[:1]) == ([best] if best > reward_save else [])
    assert all(
        best - e.reward <= 0.005 for e in choose(candidates, k_top, reward_save)[:1]
    )


# --- strategies -------------------------------------------------------------------------------------------------


def test_offspring_of_the_elites_is_asked_for():
    search, designer = strategy("vlmgineer")
    assert [c.generation for c in search.ask()] == [0]
    search.tell([earned(0.9, 0), earned(0.6, 1), earned(0.4, 2)])
    assert [c.generation for c in search.ask()] == [1]
    assert designer.asked == [(0, []), (1, ["g0-a0-s0-p0", "g0-a0-s1-p0"])]


def test_a_fresh_sampling_where_nobody_passes():
    search, designer = strategy("vlmgineer")
    search.ask()
    search.tell([earned(0.5), earned(0.1, 1)])
    search.ask()
    search.tell([])
    search.ask()
    assert designer.asked == [(0, []), (1, []), (2, [])]


@pytest.mark.parametrize(
    ("elites_from", "parents"),
    [
        ("generation", ["g1-a0-s0-p0"]),
        ("best", ["g0-a0-s0-p0", "g1-a0-s0-p0"]),
        ("run", ["g0-a0-s0-p0", "g0-a0-s1-p0", "g1-a0-s0-p0"]),
    ],
)
def test_where_elites_come_from(elites_from, parents):
    search, designer = strategy("vlmgineer", elites_from=elites_from)
    search.ask()
    search.tell([earned(0.9), earned(0.8, 1)])
    search.ask()
    search.tell([earned(0.7, generation=1)])
    search.ask()
    assert designer.asked[-1] == (2, parents)


@pytest.mark.parametrize(("k_top", "shown"), [(5, [2, 0]), (1, [2])])
def test_the_best_two_tools_are_shown_even_if_they_earned_nothing(k_top, shown):
    search, designer = strategy("vlmgineer", k_top=k_top, k_least=2)
    search.ask()
    search.tell([earned(0.1), earned(0.0, 1), earned(0.2, 2), earned(0.15, 2, 1)])
    search.ask()
    assert designer.asked[-1] == (1, [f"g0-a0-s{number}-p0" for number in shown])
    search.tell([])
    search.tell([earned(1.0, 3, status="rejected")])
    search.ask()
    assert designer.asked[-1] == (3, [f"g0-a0-s{shown[0]}-p0"])


@pytest.mark.parametrize(
    ("place", "reward", "admitted"),
    [(0, 0.0, True), (1, 0.0, True), (2, 0.0, False), (2, 0.5, False), (2, 0.51, True)],
)
def test_a_budget_admits_the_best_and_what_earned_enough(place, reward, admitted):
    assert Budget(1, 1, 1, 0, 5, 0.5, k_least=2).admits(place, reward) == admitted


def test_of_an_archive_the_best_two_are_shown_even_if_they_earned_nothing():
    search, designer = strategy("map_elites", k_top=3, k_least=2)
    search.ask()
    search.tell([earned(0.1, 0, distance=n / 3) for n in range(1, 4)])
    search.ask()
    assert len(designer.asked[-1][1]) <= 2
    search.tell([earned(0.2, 1), earned(0.3, 2)])
    search.ask()
    assert designer.asked[-1][1][0] == "g0-a0-s2-p0"


def test_the_best_is_shown_again_after_a_generation_that_earns_nothing():
    search, designer = strategy("vlmgineer")
    for rewards in ((1.0, 0.9), (0.0, 0.0), (0.0, 0.0)):
        search.ask()
        search.tell([earned(reward, number) for number, reward in enumerate(rewards)])
    search.ask()
    assert designer.asked[-1] == (3, ["g0-a0-s0-p0"])


def test_elites_come_from_two_places_only():
    with pytest.raises(Exception, match="elites_from"):
        strategy("vlmgineer", elites_from="dreams")


def test_sampling_never_evolves():
    search, designer = strategy("sampling", reward_save=0.0)
    for _ in range(3):
        search.ask()
        search.tell([earned(1.0)])
    assert designer.asked == [(0, []), (1, []), (2, [])]

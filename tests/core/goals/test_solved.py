"""Solved means every goal within its own tolerance and every limit kept: met by a little, and missed by a little."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from core.goals import (
    Apart,
    Away,
    Kept,
    Placed,
    Reach,
    Span,
    are_goals_met,
    goals_margins,
    goals_reward,
)
from core.plugins import installed
from core.scene import State, Trace

START = State(
    ("cube", "ball"),
    np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]),
    np.array([[1.0, 0.0, 0.0, 0.0]] * 2),
    np.zeros((2, 3)),
    np.zeros((2, 3)),
)


def ended(**places):
    positions = START.positions.copy()
    for name, place in places.items():
        positions[START.names.index(name)] = place
    return State(START.names, positions, *START.arrays[1:])


def is_solved(goals, end, every=True, trace=None):
    """Say whether goals are met, as all that measure it say: a reward of 1 and no margin beyond its limit."""
    aim = SimpleNamespace(goals=goals, every=every)
    solved = are_goals_met(aim, START, end, trace)
    reward = float(goals_reward(aim, START, end, trace))
    assert solved == (reward == pytest.approx(1, abs=1e-9))
    return solved


BROUGHT = Placed(("cube",), place=(0.5, 0.0, 0.0), tolerance=0.012)


@pytest.mark.parametrize(
    ("goals", "met", "missed"),
    [
        ((BROUGHT,), {"cube": (0.5119, 0, 0)}, {"cube": (0.5121, 0, 0)}),
        # Half a metre on the way adds nothing to a tolerance.
        ((BROUGHT,), {"cube": (0.5, 0.0119, 0)}, {"cube": (0.5185, 0, 0)}),
        (
            (Away(("cube",), away=0.2),),
            {"cube": (-0.2001, 0, 0)},
            {"cube": (-0.1999, 0, 0)},
        ),
        (
            (Apart(("cube", "ball"), apart=Span(low=1.5)),),
            {"cube": (-0.5001, 0, 0)},
            {"cube": (-0.4999, 0, 0)},
        ),
        (
            (BROUGHT, Kept(("ball",), kept_m=0.01)),
            {"cube": (0.5, 0, 0), "ball": (1.0099, 0, 0)},
            {"cube": (0.5, 0, 0), "ball": (1.0101, 0, 0)},
        ),
        (
            (BROUGHT, Placed(("ball",), place=(1.0, 0.2, 0.0), tolerance=0.001)),
            {"cube": (0.5, 0, 0), "ball": (1.0, 0.2009, 0)},
            {"cube": (0.5, 0, 0), "ball": (1.0, 0.2011, 0)},
        ),
    ],
)
def test_it_is_solved_up_to_the_tolerance_and_no_farther(goals, met, missed):
    assert is_solved(goals, ended(**met))
    assert not is_solved(goals, ended(**missed))


ONE = Placed(("cube", "ball"), place=(0.5, None, None), tolerance=0.01, any=True)
HALF = (0.5, 0.0, 0.0)


@pytest.mark.parametrize(
    ("goal", "met", "missed"),
    [
        # One of two bodies has to do all of it.
        (
            replace(ONE, also=(Placed(("cube",), place=(None, 0.2, None), tolerance=0.01),)),
            {"cube": (0.5, 0.2, 0)},
            {"cube": (0.5, 0, 0), "ball": (1, 0.2, 0)},
        ),
        (replace(ONE, any=False, enough=1), {"ball": HALF}, {"ball": (0.52, 0, 0)}),
        (replace(ONE, any=False), {"cube": HALF, "ball": HALF}, {"ball": HALF}),
        # What allows nothing has no room, and is met or missed.
        (replace(BROUGHT, tolerance=0.0), {"cube": HALF}, {"cube": (0.5001, 0, 0)}),
    ],
)  # fmt: skip
def test_as_many_bodies_as_are_enough_have_to_do_all_of_it(goal, met, missed):
    assert is_solved((goal,), ended(**met))
    assert not is_solved((goal,), ended(**missed))


def stay(*places):
    return Trace.of(START, *[ended(cube=place) for place in places])


TOUCHED = {("tool", "rod", "cube"): np.array([False, True, True])}
LAID = {("body", "cube", "table"): np.array([True, True, True])}


@pytest.mark.parametrize(
    ("goal", "met", "missed"),
    [
        (replace(BROUGHT, ever=True), stay(HALF, START.positions[0]), stay((0.4, 0, 0), HALF[::-1])),
        (replace(BROUGHT, ever=True, by_s=0.05), stay(HALF, HALF), stay((0.4, 0, 0), HALF)),
        (Reach(("cube",), held=True), replace(stay(HALF, HALF), touching=TOUCHED), stay(HALF, HALF)),
        (
            Reach(("cube",), held=True),
            replace(stay(HALF, HALF), touching=TOUCHED),
            replace(stay(HALF, HALF), touching=TOUCHED | LAID),
        ),
        (Reach(("cube",), released=True), stay(HALF, HALF), replace(stay(HALF, HALF), touching=TOUCHED)),
        (
            Reach(("cube",), stands_on="ball"),
            replace(stay(HALF, HALF), forces={("cube", "ball"): np.array([0.0, 2.0, 2.0])}),
            replace(stay(HALF, HALF), forces={("cube", "ball"): np.array([2.0, 2.0, 0.0])}),
        ),
    ],
)  # fmt: skip
def test_a_yes_or_no_without_room_counts_as_well(goal, met, missed):
    assert is_solved((goal,), met.states[-1], trace=met)
    assert not is_solved((goal,), missed.states[-1], trace=missed)


def test_margins_are_those_of_the_instant_that_counts():
    film = stay((0.495, 0, 0), (0.3, 0, 0))
    goals = (replace(BROUGHT, ever=True),)
    aim = SimpleNamespace(goals=goals, every=True)
    (margin,) = goals_margins(aim, START, film.states[-1], film)
    assert margin.value == pytest.approx(0.005)


def test_of_goals_one_of_which_is_enough_one_is_enough():
    other = Placed(("ball",), place=(2.0, 0.0, 0.0), tolerance=0.01)
    end = ended(cube=(0.5, 0, 0))
    assert is_solved((BROUGHT, other), end, every=False)
    assert not is_solved((BROUGHT, other), end, every=True)


@pytest.mark.parametrize(
    ("name", "reward", "solved"),
    [
        ("BringCube", 0.951, True),
        ("BringCube", 0.949, False),
        ("AroundCorner", 0.999, False),
        ("AroundCorner", 1 - 1e-12, True),
    ],
)
def test_the_papers_tasks_keep_its_rule(name, reward, solved):
    assert installed().create("task", name).is_paid(reward) == solved

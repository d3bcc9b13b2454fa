"""Solved means every goal within its own tolerance and every limit kept: met by a little, and missed by a little."""

from types import SimpleNamespace

import numpy as np
import pytest

from core.goals import (
    Apart,
    Away,
    Kept,
    Placed,
    Span,
    goals_margins,
    goals_reward,
)
from core.plugins import installed
from core.scene import State
from core.task import Task

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


def is_solved(goals, end, every=True):
    aim = SimpleNamespace(goals=goals, every=every)
    reward = float(goals_reward(aim, START, end))
    return Task.is_solved(SimpleNamespace(success_reward=Task.success_reward), reward)


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
    for end, least in ((met, 0.0), (missed, -1.0)):
        aim = SimpleNamespace(goals=goals, every=True)
        margins = goals_margins(aim, START, ended(**end))
        worst = min(margin.margin for margin in margins)
        assert worst >= 0 if least == 0 else worst < 0


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
    assert installed().create("task", name).is_solved(reward) == solved

"""Of winners that hold alike, one whose tool can be made is preferred, and of these the lightest."""

from types import SimpleNamespace

import numpy as np
import pytest

from core.design import Candidate, Component, Tool
from core.events import Generation, Result
from core.geometry import Box, Pose
from core.interfaces import Condition, Fitness, Material, Waypoints
from core.search import makers
from core.search.finalists import Race, note_making
from core.search.makers import Judge
from core.search.trials import Trials
from core.trial import TIE, Making, Trial, Where
from core.values.materials import PAPER
from plugins.conformance.evaluations import tried_once
from tests.support.executors import Inline
from tests.support.playing import Named

PLA = Material("pla", 1240.0)


class Once(Fitness):
    """One engine, and so many layouts at the end."""

    def __init__(self, count=10**6):
        self.count = count

    def conditions(self):
        return [Condition(Named("BringCube"), Named("pybullet"))]

    def score(self, candidate, trials):
        raise AssertionError

    def finals(self):
        for layout in range(self.count):
            yield [Condition(Named("BringCube"), Named("pybullet"), layout)]


def design(number, grams, reward=1.0):
    """A design that earns this in every layout, with a tool that weighs so much."""
    box = Component("box", "tool_mount", Pose(), Box((0.1,) * 3), grams / 1000)
    plan = Waypoints(np.array([[0.0, 0.0, 0.5, 0.0, 0.0, number]]))
    candidate = Candidate(Tool((box,), name=f"{grams} g"), plan, 0, number)
    where = Where("BringCube", "pybullet", 0)
    return tried_once(candidate, "ok", reward, 0.5 + number / 10, where=where)


def play(condition, candidates):
    return [
        Trial(condition.where, candidate.id, reward=1.0, solved=True)
        for candidate in candidates
    ]


def choose(
    monkeypatch, designs, can, material=PLA, rollouts=480, layouts=10**6, playing=play
):
    """Return the result of a race, and the grams of the tools that a plugin looked at; ``can`` names what it makes."""
    looked = []

    def make(run, condition, tried):
        looked.append(round(1000 * tried.candidate.tool.mass))
        if can == "broken":
            raise ValueError("no plate")
        if looked[-1] in can:
            return Making(True, "yes")
        return Making(False, "no (a loop)", "a loop")

    plugins = SimpleNamespace(
        factories=lambda kind: {"mine": make},
        offers={("maker", "mine"): SimpleNamespace(owner="plugin mine")},
    )
    monkeypatch.setattr(makers, "installed", lambda: plugins)

    fitness = Once(layouts)
    run = SimpleNamespace(representation=SimpleNamespace(material=material))
    judge = Judge(run, fitness.conditions())
    trials = Trials(Inline(), play=playing)
    race = Race(fitness.finals(), fitness, trials, TIE, judge=judge)
    found = race.choose(Result((Generation(0, tuple(designs)),), 1.0), rollouts)
    return note_making(found, judge), looked


@pytest.mark.parametrize(
    ("can", "won"), [((300, 200), 200), ((100, 200), 100), ((300,), 300)]
)
def test_of_those_that_hold_alike_the_lightest_that_can_be_made_wins(
    monkeypatch, can, won
):
    designs = [design(0, 300), design(1, 200), design(2, 100)]
    result, _ = choose(monkeypatch, designs, can)
    assert round(1000 * result.winner.candidate.tool.mass) == won
    assert result.making == Making(True, "yes")
    assert result.makeable is None


def test_where_none_can_be_made_the_shortest_way_wins_and_another_is_named(monkeypatch):
    designs = [design(0, 300), design(1, 200), design(2, 100, reward=0.9)]
    result, _ = choose(monkeypatch, designs, (100,))
    assert result.winner.candidate.agent == 0
    assert result.making.problem == "a loop"
    assert result.makeable.candidate.agent == 2


def test_by_the_papers_convention_it_is_said_and_does_not_decide(monkeypatch):
    designs = [design(0, 300), design(1, 200)]
    result, looked = choose(monkeypatch, designs, (200,), PAPER)
    assert result.winner.candidate.agent == 0
    assert result.making.possible is False
    assert result.makeable is None
    assert looked == [300]


def test_few_tools_are_looked_at_each_once(monkeypatch):
    designs = [design(number, 100 + number) for number in range(18)]
    result, looked = choose(monkeypatch, designs, ())
    assert result.winner.candidate.agent == 0
    assert looked[:5] == [100, 101, 102, 104, 108]
    assert len(looked) == len(set(looked)) < len(designs)


def test_far_heavier_tools_are_looked_at_where_the_lightest_can_not_be_made(
    monkeypatch,
):
    designs = [design(number, 100 + number) for number in range(40)]
    result, _ = choose(monkeypatch, designs, range(120, 200))
    assert round(1000 * result.winner.candidate.tool.mass) == 132


def test_few_tools_are_looked_at_where_the_one_that_can_be_made_does_not_hold(
    monkeypatch,
):
    """Each look plays a design in all engines, which takes longer than many rollouts."""
    worse = design(35, 165, reward=0.9).candidate.id

    def play_worse(condition, candidates):
        rewards = [0.9 if item.id == worse else 1.0 for item in candidates]
        return [
            Trial(condition.where, item.id, reward=reward, solved=True)
            for item, reward in zip(candidates, rewards, strict=True)
        ]

    designs = [design(number, 200 - number) for number in range(40)]
    result, looked = choose(monkeypatch, designs, (165,), layouts=2, playing=play_worse)
    assert result.making.problem == "a loop"
    assert len(looked) < 20


def test_a_plugin_that_raises_is_named_and_costs_no_run(monkeypatch):
    result, _ = choose(monkeypatch, [design(0, 300)], "broken")
    assert result.making.possible is None
    assert "plugin mine raised ValueError: no plate" in result.making.words

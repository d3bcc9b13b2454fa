"""A kind of goal says where it wants bodies, for who plans, and what it does not say follows from what it does."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

from core.errors import UsageError
from core.goals import (
    Apart,
    Away,
    Key,
    Limit,
    Measure,
    Placed,
    Reach,
    Span,
    Turned,
    find_wants,
)
from tests.support.goal_scenes import CUBE, SCENE, START


@dataclass(frozen=True, kw_only=True)
class Above(Reach):
    """A stranger's kind, which says no more than what it measures, and by which keys."""

    height: float
    lid: str = "case"

    keys: ClassVar = {"height": Key(float, "How high they must end, m", head=True)}
    names: ClassVar = {"lid": "body"}

    def measures(self, body, start):
        return [Measure(body, lambda s: s.position(body)[..., 2], 1, 0.1, "m")]


class Strange(Limit):
    """A stranger's limit, which says nothing."""

    def share(self, evidence):
        return np.ones(())

    def margins(self, evidence):
        return []


def test_wants_are_in_the_world_and_one_for_each_place():
    places = ((0.1, 0.0, 0.0), (0.2, None, 0.0))
    goal = Placed(
        ("cube", "other"),
        places=places,
        at="mark",
        tolerance=0.01,
        held=True,
        also=(Turned(axis=(1.0, 0.0, 0.0), at="mark"),),
    )
    first, second, _ = find_wants((goal, Away(CUBE, away=0.1, after=0)), SCENE)
    assert first.bodies == CUBE
    assert first.place == pytest.approx((0.6, 0.1, 0.0))
    assert second.place == (0.7, None, 0.0)
    assert (first.axis, first.points) == ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert (first.reference, first.tolerance, first.held) == ("mark", 0.01, True)


def test_bodies_to_be_apart_get_away_from_the_first():
    goal = Apart(("cube", "other"), apart=Span(low=0.3))
    aims = [want.place for want in goal.wants(SCENE)]
    assert aims[0][:2] == tuple(START.position("cube")[:2])
    assert aims[1][:2] == pytest.approx((0.83, -0.3))


def test_a_strangers_kind_says_what_it_can():
    goal = Above(CUBE, height=0.3)
    assert goal.describe() == "cube Above(height=0.3, lid='case')"
    assert goal.in_short() == "fulfil Above of cube"
    assert goal.wants(SCENE)[0].unsaid == ("Above",)
    assert Above.read("height", {"bodies": CUBE, "height": 0.3}) == goal
    assert Above.keys.keys() == Reach.keys.keys() | {"height"}
    with pytest.raises(UsageError, match="no body 'pot'"):
        replace(goal, lid="pot").check_names(SCENE)
    assert Strange().describe() == "Strange()"

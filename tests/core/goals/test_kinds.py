"""A kind of goal says all of itself: in short, for a prompt, and for who plans."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

from core.errors import UsageError
from core.goals import (
    KINDS,
    Apart,
    Away,
    Broken,
    Facing,
    Flattened,
    Inside,
    JointAt,
    Kept,
    Key,
    Limit,
    Measure,
    Placed,
    Reach,
    Span,
    Spread,
    Throughout,
    Turned,
    TurnedBy,
    Unbroken,
    Untouched,
    find_wants,
)
from tests.core.goals.test_goals import CUBE, SCENE, START

REACHES = {
    Placed: (Placed(CUBE, place=(0.7, 0.1, None)), "bring cube to its place"),
    Inside: (Inside(CUBE, inside="case"), "bring cube into case"),
    Away: (Away(CUBE, away=0.1), "move cube by 0.1 m"),
    JointAt: (JointAt(joint="drawer", to=0.2), "move the joint drawer"),
    Apart: (
        Apart(("cube", "other"), apart=Span(low=0.3)),
        "bring cube, other to be at least 0.3 m apart",
    ),
    Flattened: (Flattened(CUBE, max_height_m=0.02), "flatten cube to 0.02 m"),
    Spread: (Spread(CUBE, min_area_m2=0.1), "spread cube over 0.1 m^2"),
    Turned: (Turned(CUBE, points=(1.0, 0.0, 0.0)), "turn cube"),
    TurnedBy: (
        TurnedBy(CUBE, turned_deg=Span(low=90)),
        "turn cube by at least 90 degrees",
    ),
    Facing: (Facing(CUBE, facing="mark"), "turn cube to mark"),
    Broken: (Broken(broken=("cube",)), "break cube"),
}
LIMITS = {
    Kept: Kept(CUBE),
    Untouched: Untouched(CUBE, max_force_n=2.0),
    Unbroken: Unbroken(CUBE),
    Throughout: Throughout(Turned(CUBE)),
}


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


def test_each_kind_is_here():
    assert {*REACHES, *LIMITS} == {*KINDS}


@pytest.mark.parametrize("kind", REACHES)
def test_a_kind_says_in_short_and_in_words_what_it_wants(kind):
    goal, short = REACHES[kind]
    assert goal.in_short() == short
    assert kind.__name__ not in goal.describe()
    if goal.bodies:
        held = Reach(goal.bodies, held=True, also=(goal,))
        assert held.in_short() == short


@pytest.mark.parametrize("kind", LIMITS)
def test_a_limit_says_in_words_what_it_forbids(kind):
    assert "cube" in LIMITS[kind].describe()
    assert kind.__name__ not in LIMITS[kind].describe()


@pytest.mark.parametrize("kind", REACHES)
def test_a_kind_says_where_it_wants_bodies_or_that_it_does_not(kind):
    goal, _ = REACHES[kind]
    (want, *_) = find_wants((Kept(("box",)), goal), SCENE)
    said = (
        want.place,
        want.away,
        want.axis,
        want.joint,
        want.breaks,
    )
    assert any(said) == (not want.unsaid)
    assert want.unsaid == ((kind.__name__,) if kind in (Flattened, Spread) else ())
    assert want.number == 1


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

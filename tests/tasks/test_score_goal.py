from dataclasses import replace

import numpy as np
import pytest

from core.geometry import Cylinder, Pose
from core.robot.solids import Solid, body_solids, signed_distance, solid_geometry
from core.scene import State
from core.task import margins_of
from tasks.score_goal import PUCK_HEIGHT, PUCK_RADIUS, START, ScoreGoal

TASK = ScoreGoal()
SCENE = TASK.scene(0)
BEFORE = SCENE.state()
LYING = PUCK_HEIGHT / 2
GOAL = SCENE["goal"]


def reward(*places):
    ends = [
        replace(BEFORE, positions=np.array([place], dtype=float)) for place in places
    ]
    return TASK.reward(State.stack([BEFORE] * len(ends)), State.stack(ends)).tolist()


def gap(puck):
    """Metres between a puck, in the goal's frame, and the goal; negative: penetration of a bar or a net."""
    disc = Solid(
        "puck", solid_geometry(Cylinder(PUCK_RADIUS, PUCK_HEIGHT)), GOAL.pose @ puck
    )
    return min(signed_distance(disc, part) for part in body_solids(GOAL))


def lying(x, y):
    """A puck on the ice, in the goal's frame."""
    return GOAL.pose.inverse() @ Pose.xyz_rpy((x, y, LYING))


@pytest.mark.parametrize("friction", ["puck", 0.5])
def test_what_slides_on_the_floor_slides_as_if_on_ice(friction):
    # 0.5: tools.
    other = SCENE[friction].friction if isinstance(friction, str) else friction
    assert np.sqrt(SCENE["floor"].friction * other) == pytest.approx(0.1)


def test_the_way_to_the_goal():
    way = np.subtract((2.0, 0.0, LYING), START)
    np.testing.assert_allclose(
        reward(
            *[np.add(START, share * way) for share in (0, 0.25, 0.5, 0.75, 0.95, 1)]
        ),
        [0, 0.25, 0.5, 0.75, 1, 1],
    )


@pytest.mark.parametrize("x", [1.88, 2.0, 2.12])
@pytest.mark.parametrize("y", [-0.22, 0.0, 0.22])
@pytest.mark.parametrize("z", [LYING, 0.1, 0.3])
def test_anywhere_in_the_goal_is_a_goal(x, y, z):
    assert reward((x, y, z)) == [1]
    end = replace(BEFORE, positions=np.array([(x, y, z)]))
    room = [margin.margin for margin in margins_of(TASK, BEFORE, end, None, 1.0)]
    lengthwise, across = 1 - abs(x - 2.0) / 0.127, 1 - abs(y) / 0.2285
    assert room == pytest.approx(sorted((lengthwise, across)))


@pytest.mark.parametrize(("y", "inside"), [(0.228, True), (0.229, False)])
def test_beside_the_goal_the_room_is_less_than_none(y, inside):
    end = replace(BEFORE, positions=np.array([(2.0, y, LYING)]))
    earned = float(TASK.reward(BEFORE, end))
    least = margins_of(TASK, BEFORE, end, None, earned)[0]
    assert (earned == 1, least.margin >= 0) == (inside, inside)


@pytest.mark.parametrize(
    "place",
    [
        (1.86, 0, LYING),
        (2.14, 0, LYING),
        (2.0, 0.24, LYING),
        (2.0, -0.24, LYING),
        (2.1, 0.2, 0.34),
        (2.1, 0.2, -0.05),
    ],
)
def test_next_to_it_above_it_or_below_it_the_horizontal_distance_counts(place):
    (earned,) = reward(place)
    assert earned < 0.95
    assert earned == pytest.approx(
        1 - np.hypot(place[0] - 2.0, place[1]) / np.hypot(1.2, 0.6)
    )


def test_the_mouth_is_open_and_the_rest_is_shut():
    assert all(
        gap(lying(x, y)) > 0
        for x in np.linspace(1.7, 2.08, 20)
        for y in (-0.19, 0.0, 0.19)
    )
    for inside, outside in [
        ((2.0, 0), (2.3, 0)),
        ((2.0, 0), (2.0, 0.4)),
        ((2.0, 0), (2.0, -0.4)),
    ]:
        way = [
            np.add(inside, share * np.subtract(outside, inside))
            for share in np.linspace(0, 1, 40)
        ]
        assert min(gap(lying(*place)) for place in way) < 0
    assert min(gap(lying(1.85, y)) for y in (-0.2475, 0.2475)) < 0  # the posts

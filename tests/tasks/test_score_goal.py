from dataclasses import replace

import coal
import numpy as np
import pytest

from core.geometry import Cylinder
from core.scene import State
from tasks.score_goal import PUCK_HEIGHT, PUCK_RADIUS, START, ScoreGoal

TASK = ScoreGoal()
SCENE = TASK.scene(0)
BEFORE = SCENE.state()
LYING = PUCK_HEIGHT / 2


def reward(*places):
    ends = [replace(BEFORE, positions=np.array([place], dtype=float)) for place in places]
    return TASK.reward(State.stack([BEFORE] * len(ends)), State.stack(ends)).tolist()


def gap(place):
    """Metres between a puck lying at a place (x, y) and the goal; negative is how deep it is in a bar or in the net."""
    puck, at = coal.Cylinder(PUCK_RADIUS, PUCK_HEIGHT), coal.Transform3s(np.eye(3), np.array([*place, LYING]))
    gaps = []
    for part in SCENE["goal"].collisions:
        shape, pose = part.shape, SCENE["goal"].pose @ part.pose
        solid = coal.Cylinder(shape.radius, shape.length) if isinstance(shape, Cylinder) else coal.Box(*shape.size)
        there = coal.Transform3s(pose.rotation.as_matrix(), pose.position)
        gaps.append(coal.distance(puck, at, solid, there, coal.DistanceRequest(), coal.DistanceResult()))
    return min(gaps)


def test_the_scene():
    puck = SCENE["puck"]
    assert (puck.collisions[0].shape.radius, puck.collisions[0].shape.length, puck.mass) == (0.038, 0.025, 0.17)
    np.testing.assert_allclose(puck.pose.position, [0.8, 0.6, 0.0125])
    assert SCENE["goal"].fixed
    assert all(part.shape.radius == 0.019 for part in SCENE["goal"].collisions if isinstance(part.shape, Cylinder))
    assert "table" not in [body.name for body in SCENE.bodies]


@pytest.mark.parametrize("friction", ["puck", 0.5])
def test_what_slides_on_the_floor_slides_as_if_on_ice(friction):
    other = SCENE[friction].friction if isinstance(friction, str) else friction  # 0.5: tools
    assert np.sqrt(SCENE["floor"].friction * other) == pytest.approx(0.1)


def test_the_way_to_the_goal():
    way = np.subtract((2.0, 0.0, LYING), START)
    np.testing.assert_allclose(
        reward(*[np.add(START, share * way) for share in (0, 0.25, 0.5, 0.75, 0.95, 1)]), [0, 0.25, 0.5, 0.75, 1, 1]
    )


@pytest.mark.parametrize("x", [1.88, 2.0, 2.12])
@pytest.mark.parametrize("y", [-0.22, 0.0, 0.22])
@pytest.mark.parametrize("z", [LYING, 0.1, 0.3])
def test_anywhere_in_the_goal_is_a_goal(x, y, z):
    assert reward((x, y, z)) == [1]


@pytest.mark.parametrize(
    "place",
    [(1.86, 0, LYING), (2.14, 0, LYING), (2.0, 0.24, LYING), (2.0, -0.24, LYING), (2.1, 0.2, 0.34), (2.1, 0.2, -0.05)],
)
def test_next_to_it_above_it_or_below_it_the_horizontal_distance_counts(place):
    (earned,) = reward(place)
    assert earned < 0.95
    assert earned == pytest.approx(1 - np.hypot(place[0] - 2.0, place[1]) / np.hypot(1.2, 0.6))


@pytest.mark.parametrize("place", [(0.8, 0.8, LYING), (3.5, 0, LYING), (2.0, -1.5, LYING), (9, 9, -3)])
def test_a_puck_shot_past_or_the_wrong_way_earns_nothing(place):
    assert reward(place) == [0]


def test_the_mouth_is_open_and_the_rest_is_shut():
    assert all(gap((x, y)) > 0 for x in np.linspace(1.7, 2.08, 20) for y in (-0.19, 0.0, 0.19))
    for inside, outside in [((2.0, 0), (2.3, 0)), ((2.0, 0), (2.0, 0.4)), ((2.0, 0), (2.0, -0.4))]:
        assert min(gap(np.add(inside, share * np.subtract(outside, inside))) for share in np.linspace(0, 1, 40)) < 0
    assert min(gap((1.85, y)) for y in (-0.2475, 0.2475)) < 0  # the posts

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.scene import State
from tasks.clean_table import COUNT, DUST, SIDE, CleanTable, litter

TASK = CleanTable()
BEFORE = TASK.scene(0).state()
MIDDLE = np.array([1.1, 0.0, SIDE / 2])


def reward(*ends, start=BEFORE):
    """The reward for positions (8, 3) of the cubes."""
    states = [replace(start, positions=np.asarray(end, dtype=float)) for end in ends]
    return TASK.reward(State.stack([start] * len(states)), State.stack(states))


def corners(x, y, yaw):
    """The corners (4, 2) of a cube in the top view."""
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    return np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * SIDE / 2 @ turn.T + (x, y)


def apart(one, other):
    """Report whether a side of one of two convex outlines separates them."""
    for outline in (one, other):
        for edge in np.roll(outline, -1, axis=0) - outline:
            a, b = (points @ (edge[1], -edge[0]) for points in (one, other))
            if a.max() < b.min() or b.max() < a.min():
                return True
    return False


def test_the_scene():
    scene = TASK.scene(0)
    assert BEFORE.names == DUST
    assert len(DUST) == COUNT == 8
    for name in DUST:
        assert scene[name].collisions[0].shape.size == (0.03, 0.03, 0.03)
        assert scene[name].pose.position[2] == pytest.approx(0.015)
        assert 0 < scene[name].mass <= 0.02
    circle = scene["circle"]
    np.testing.assert_allclose(circle.pose.position, [1.1, 0, 0])
    assert circle.visuals[0].shape.radius == 0.15
    assert not circle.collisions


@pytest.mark.parametrize("block", range(4))
def test_no_two_cubes_touch_with_any_seed(block):
    for seed in range(50 * block, 50 * (block + 1)):
        places = litter(seed)
        assert len(places) == 8
        assert all(0.5 <= x <= 0.9 and -0.2 <= y <= 0.2 for x, y, _ in places)
        outlines = [corners(*place) for place in places]
        assert all(apart(outlines[i], outlines[j]) for i in range(8) for j in range(i))


def test_the_layout_follows_the_seed():
    assert litter(3) == litter(3)
    assert len({tuple(litter(seed)) for seed in range(200)}) == 200


@given(seed=st.integers(0, 1000), shares=st.tuples(st.floats(0, 1), st.floats(0, 1)))
def test_it_rises_from_0_to_1_on_the_way(seed, shares):
    start = TASK.scene(seed).state()
    less, more = (start.positions + share * (MIDDLE - start.positions) for share in sorted(shares))
    nothing, low, high, everything = reward(start.positions, less, more, np.tile(MIDDLE, (8, 1)), start=start)
    assert nothing == 0
    assert low <= high + 1e-12
    assert everything == 1


def test_each_cube_counts_an_eighth():
    end = BEFORE.positions.copy()
    for count in range(8):
        assert reward(end)[0] == pytest.approx(count / 8)
        end[count] = np.add(MIDDLE, (0.1, -0.1, 0))
    assert reward(end)[0] == 1


def test_inside_is_a_centimetre_more_than_the_circle():
    end = np.tile(MIDDLE, (8, 1))
    end[3] = np.add(MIDDLE, (0, 0.1599, 0))
    almost = end.copy()
    almost[3] = np.add(MIDDLE, (0, 0.1601, 0))
    whole = np.linalg.norm(BEFORE.positions[3] - MIDDLE)
    np.testing.assert_allclose(reward(end, almost), [1, 7 / 8 + (1 - 0.1601 / whole) / 8])


def test_cubes_swept_off_the_table_or_thrown_far_earn_nothing():
    under_the_circle = np.tile([1.1, 0, -0.61], (8, 1))
    far = np.tile([3.0, 1.0, -0.61], (8, 1))
    nearer_the_robot = BEFORE.positions - (0.1, 0, 0)
    np.testing.assert_array_less(reward(under_the_circle, far, nearer_the_robot), 0.02)

from dataclasses import replace

import numpy as np
import pytest

from core.scene import State
from tasks.gather_spheres import NAMES, RADIUS, WANTED_HEIGHT, GatherSpheres

TASK = GatherSpheres()
START = TASK.scene(0).state()


def raised(heights):
    """The start state with the spheres at other heights, one for all or one for each."""
    positions = START.positions.copy()
    positions[:, 2] = heights
    return replace(START, positions=positions)


def test_reward_rises_in_step_with_the_spheres_lifted():
    lifted = [raised(z) for z in np.linspace(RADIUS, WANTED_HEIGHT, 11)]
    rewards = np.array([TASK.reward(START, end) for end in lifted])
    assert rewards == pytest.approx(np.linspace(0, 1, 11))
    assert TASK.reward(State.stack([START] * 11), State.stack(lifted)) == pytest.approx(
        rewards
    )


def test_each_sphere_counts_the_same_and_higher_than_wanted_is_no_better():
    heights = np.full(len(NAMES), RADIUS)
    rewards = []
    for number in range(len(NAMES)):
        heights[number] = 0.5
        rewards.append(float(TASK.reward(START, raised(heights))))
    assert rewards == pytest.approx(np.arange(1, 31) / 30)


def test_a_sphere_on_the_floor_does_not_change_the_others_reward():
    heights = np.full(len(NAMES), WANTED_HEIGHT)
    heights[0] = -0.6
    assert TASK.reward(START, raised(heights)) == pytest.approx(29 / 30)

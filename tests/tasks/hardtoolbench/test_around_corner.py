"""Requirements for AroundCorner's reward."""

from dataclasses import replace

import numpy as np
import pytest

from core.scene import Pose
from tasks.hardtoolbench.around_corner import LENGTH, OPENING, TOLERANCE, AroundCorner

TASK = AroundCorner(variation="wide")
SCENE = TASK.scene(3)
START = SCENE.state()


def reward(at, frame="box", raised=0.0, speed=0.0):
    """The reward of a cube that ends at a place in a body's frame."""
    pose = SCENE[frame].pose @ Pose.xyz_rpy((*at, 0.02 + raised))
    moving = np.array([[speed, 0.0, 0.0]])
    return float(
        TASK.reward(
            START,
            replace(START, positions=pose.position[None], linear_velocities=moving),
        )
    )


def test_a_cube_on_the_mark_is_done():
    assert reward((0.0, 0.9 * TOLERANCE), "mark") == 1.0
    assert 0.5 < reward((0.0, 2 * TOLERANCE), "mark") < 1.0


@pytest.mark.parametrize("case", [{"raised": 0.02}, {"raised": 0.3}, {"speed": 0.4}])
def test_a_cube_held_above_the_mark_or_flung_across_it_was_not_left_there(case):
    assert reward((0.0, 0.0), "mark", **case) == pytest.approx(0.3)


def test_progress_rises_all_the_way():
    inside = [
        reward((x, 0.0)) for x in (0.03 - LENGTH / 2, 0.0, OPENING, OPENING + 0.029)
    ]
    outside = [reward((x, 0.0), "mark") for x in (-0.1, -0.06, -0.03, 0.0)]
    assert inside + outside == sorted(inside + outside)
    assert inside[0] == 0.0
    assert inside[-1] < 0.3 <= outside[0]


def test_a_cube_that_fell_off_the_table_earns_nothing():
    end = replace(START, positions=SCENE["mark"].pose.position[None] - [0.0, 0.0, 0.6])
    assert TASK.reward(START, end) == 0.0

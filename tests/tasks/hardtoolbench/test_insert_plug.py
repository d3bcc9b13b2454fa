"""Requirements for InsertPlug's reward."""

from dataclasses import replace

import pytest

from core.scene import Pose
from tasks.hardtoolbench.insert_plug import InsertPlug

TASK = InsertPlug(variation="wide")
SCENE = TASK.scene(3)
START = SCENE.state()


def reward(at, rpy=(0.0, 0.0, 0.0)):
    """The reward of a plug that ends at a place in the socket's frame."""
    pose = SCENE["socket"].pose @ Pose.xyz_rpy(at, rpy)
    return float(
        TASK.reward(
            START,
            replace(
                START, positions=pose.position[None], quaternions=pose.quaternion[None]
            ),
        )
    )


def test_the_plug_is_in_at_35_mm():
    assert reward((0.002, -0.002, -0.0355)) == 1.0


def test_depth_counts_in_the_hole_alone():
    inside = [reward((0.0, 0.0, -depth)) for depth in (0.005, 0.015, 0.025)]
    assert inside == pytest.approx(
        [0.15 + 0.85 * depth / 0.035 for depth in (0.005, 0.015, 0.025)]
    )
    assert reward((0.05, 0.0, -0.03)) == 0.0


def test_the_way_to_the_socket_counts_a_little_above_its_mouth():
    earned = [reward((0.0, -away, 0.05)) for away in (0.3, 0.1, 0.0)]
    assert earned == sorted(earned)
    assert earned[-1] == pytest.approx(0.15)


@pytest.mark.parametrize("rpy", [(1.57, 0.0, 0.0), (0.0, 0.5, 0.0), (3.14, 0.0, 0.0)])
def test_a_plug_that_is_not_upright_earns_nothing(rpy):
    assert reward((0.0, 0.0, 0.01), rpy) == 0.0


def test_any_of_four_ways_round_fits():
    assert reward((0.0, 0.0, -0.036), (0.0, 0.0, 1.57)) == 1.0

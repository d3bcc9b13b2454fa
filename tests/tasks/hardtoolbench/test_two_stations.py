"""Requirements for TwoStations' reward."""

from dataclasses import replace

import numpy as np
import pytest

from core.scene import Pose
from tasks.hardtoolbench.two_stations import PRESSED, PULLED, TwoStations

TASK = TwoStations(variation="wide")
SCENE = TASK.scene(3)
START = SCENE.state()


def reward(pressed, pulled):
    """The reward of a button and a drawer that moved so far, m."""
    ways = {
        "button": Pose.xyz_rpy((pressed, 0.0, 0.0)),
        "drawer": Pose.xyz_rpy((-pulled, 0.0, 0.0)),
        "roller": Pose(),
    }
    moved = np.array([(SCENE[name].pose @ ways[name]).position for name in START.names])
    return float(TASK.reward(START, replace(START, positions=moved)))


def test_each_station_counts_by_half():
    assert reward(PRESSED, 0.0) == pytest.approx(0.5)
    assert reward(0.0, PULLED) == pytest.approx(0.5)
    assert reward(PRESSED, PULLED) == pytest.approx(1.0)


def test_a_part_of_the_way_counts_for_as_much():
    assert reward(PRESSED / 2, PULLED / 4) == pytest.approx(0.25 + 0.125)


def test_the_full_way_earns_no_more():
    assert reward(0.03, 0.1) == pytest.approx(1.0)

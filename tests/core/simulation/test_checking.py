"""What is wrong with a design is found without playing it."""

from dataclasses import replace

import numpy as np

from core.interfaces import RolloutSettings, Waypoints
from core.simulation.checking import find_problems
from tests.support.faults import Faulty, Slide, candidate
from tests.support.playing import condition


def test_problems_are_found_without_playing():
    where = condition(Slide(), Faulty(), settings=RolloutSettings(settle_s=0, hold_s=0))
    assert find_problems(where, candidate(0)) == [
        "as planned, the robot touches nothing that can move: it comes no nearer than 200 mm to block"
    ]
    far = replace(candidate(0), plan=Waypoints(np.array([[3.0, 0, 0.4, 0, 0, 0]])))
    assert "the arm misses the way to waypoint 1 by" in find_problems(where, far)[0]
    assert find_problems(where, replace(candidate(0), problem="too heavy")) == [
        "too heavy"
    ]

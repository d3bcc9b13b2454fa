from dataclasses import replace

import numpy as np
import pytest

from core.scene import Trace
from tasks.hardtoolbench.past_glasses import TIN_HEIGHT, PastGlasses

TASK = PastGlasses(variation="wide")
SCENE = TASK.scene(3)
START = SCENE.complete(SCENE.state())
MARK = np.add(START.position("mark"), (0.0, 0.0, TIN_HEIGHT / 2))


def earned(touched=(), **places):
    positions = START.positions.copy()
    for name, place in places.items():
        positions[START.names.index(name)] = place
    end = replace(START, positions=positions)
    touching = {("tool", "fork", name): np.array([True, False]) for name in touched}
    return float(TASK.reward(START, end, Trace.of(START, end, touching=touching)))


def test_the_share_of_the_way_counts_and_the_last_millimetres_are_given():
    begin = START.position("tin")
    on_the_way = [
        earned(tin=begin + share * (MARK - begin)) for share in (0.0, 0.3, 0.6, 0.9)
    ]
    assert on_the_way == sorted(on_the_way)
    assert on_the_way[0] == 0.0
    assert on_the_way[1] == pytest.approx(0.3, abs=0.02)
    assert earned(tin=np.add(MARK, (0.008, -0.008, 0.0))) == 1.0
    assert earned(tin=np.add(MARK, (0.0, 0.03, 0.0))) < 1.0


def test_a_touch_of_any_glass_costs_all_that_was_earned():
    assert earned(touched=["tin"], tin=MARK) == 1.0
    assert earned(touched=["glass_6"], tin=MARK) == 0.0


def test_a_glass_that_the_tin_pushes_costs_more_the_farther_it_goes():
    at = START.position("glass_2")
    shifts = [
        earned(tin=MARK, glass_2=np.add(at, (shift, 0.0, 0.0)))
        for shift in (0.003, 0.01, 0.02, 0.04)
    ]
    assert shifts[0] == 1.0
    assert shifts == sorted(shifts, reverse=True)
    assert shifts[-1] == 0.0


def test_a_tin_that_lies_on_its_side_earns_nothing():
    assert earned(tin=MARK - [0.0, 0.0, 0.0075]) == 0.0

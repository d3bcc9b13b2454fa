from dataclasses import replace

import numpy as np
import pytest

from core.geometry import Box, Pose
from core.robot.solids import Solid, body_solids, signed_distance, solid_geometry
from core.scene import State
from tasks.dislodge_cube import CUBE, SIDE, DislodgeCube

TASK = DislodgeCube()
SCENE = TASK.scene(0)
BEFORE = SCENE.state()
LYING = CUBE[2]


def reward(*places):
    ends = [
        replace(BEFORE, positions=np.array([place], dtype=float)) for place in places
    ]
    return TASK.reward(State.stack([BEFORE] * len(ends)), State.stack(ends)).tolist()


def gap(place, side=SIDE):
    """Metres between an upright cube and the pipe; negative: penetration of a wall."""
    cube = Solid(
        "cube",
        solid_geometry(Box((side, side, side))),
        Pose(np.array(place, dtype=float)),
    )
    return min(signed_distance(cube, part) for part in body_solids(SCENE["pipe"]))


def straight(start, end):
    return [
        np.add(start, share * np.subtract(end, start))
        for share in np.linspace(0, 1, 60)
    ]


@pytest.mark.parametrize("end", [(0.8, 0.145), (1.24, -0.1)])
def test_both_ways_out_are_open(end):
    inner = (1.24, 0.145) if end[0] < 1 else (1.24, 0.15)
    over_the_floor = LYING + 1e-4
    assert min(gap((*place, over_the_floor)) for place in straight(inner, end)) > 0


@pytest.mark.parametrize(
    "end",
    [(1.4, 0.15, LYING), (1.24, 0.4, LYING), (1.24, 0.15, 0.3), (1.0, -0.1, LYING)],
)
def test_all_other_ways_are_shut_even_to_a_small_cube(end):
    start = (1.0, 0.145, LYING) if end[0] == 1.0 else (1.24, 0.15, 0.06)
    assert min(gap(place, side=0.02) for place in straight(start, end)) < 0


def test_the_nearer_opening_counts():
    assert reward((1.07, 0.15, LYING), (1.24, 0.08, LYING)) == pytest.approx([0.5, 0.5])
    assert reward((1.07, 0.115, LYING), (1.206, 0.08, LYING)) == pytest.approx(
        [0.5, 0.5]
    )


def test_outside_in_front_of_an_opening_is_out():
    assert reward((0.8, 0.15, 0.035), (1.24, -0.05, 0.035), (0.5, -0.3, 0.035)) == [
        1,
        1,
        1,
    ]

"""What tells slips from honest pulls: the rope's crossings of the ring, the cloth's rows, and the rod."""

import numpy as np
import pytest

from tests.benchmarks import slips


@pytest.mark.parametrize(
    ("aside", "slipped"), [(0.0, False), (0.015, False), (0.04, True)]
)
def test_a_rope_slipped_where_it_no_longer_goes_through_the_ring(aside, slipped):
    case = slips.pull_ring(0.1, 1e6)
    nodes = case.soft.form.nodes + slips.AT
    tip = slips.AT + np.array([0.001, aside, 0.0])
    assert case.has_slipped(nodes, tip) == slipped


@pytest.mark.parametrize(("lowered", "slipped"), [(0.0, False), (0.05, True)])
def test_a_cloth_slipped_where_it_is_below_the_bar(lowered, slipped):
    case = slips.drag_cloth(0.1, 1e5, is_tied=False)
    nodes = case.soft.form.nodes + case.soft.pose.position
    nodes = nodes - [0.0, 0.0, lowered]
    assert case.has_slipped(nodes, slips.AT) == slipped


def test_a_cloth_slipped_where_the_rod_is_through_it():
    case = slips.drag_cloth(0.1, 1e5, is_tied=False)
    nodes = case.soft.form.nodes + case.soft.pose.position
    assert case.has_slipped(nodes, slips.AT - [0.05, 0.0, 0.1])
    assert not case.has_slipped(nodes, slips.AT - [0.05, 0.2, 0.1])

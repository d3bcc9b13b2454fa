"""Requirements for PullRope's reward: the rope goes through the ring, not around it."""

from dataclasses import replace

import numpy as np
import pytest

from tasks.softtoolbench.pull_rope import IN_EYE, PullRope

TASK = PullRope(variation="wide")


def earned(seed, by, over=0.0, tail=None):
    """The reward where the rope is moved by so much along the ring's axis, and what crosses it is lifted."""
    scene = TASK.scene(seed)
    start = scene.complete(scene.state())
    nodes = start.nodes("rope", "ring").copy()
    nodes[:, 0] += by
    nodes[np.abs(nodes[:, 0]) < 0.06, 2] += over
    if tail is not None:
        nodes[:-IN_EYE, 0] = np.linspace(
            tail, nodes[-IN_EYE, 0], len(nodes) - IN_EYE, endpoint=False
        )
    end = replace(start, soft={"rope": scene["ring"].pose.apply(nodes)})
    return float(TASK.reward(start, end))


@pytest.mark.parametrize("seed", range(4))
def test_the_whole_eye_counts_and_it_must_be_well_through(seed):
    assert earned(seed, 0.0) == pytest.approx(0.0, abs=1e-6)
    assert earned(seed, -0.2) == 1.0
    assert 0.1 < earned(seed, -0.16) < 0.95
    assert earned(seed, -0.105) < 0.1


@pytest.mark.parametrize("seed", range(4))
def test_a_rope_over_or_beside_the_ring_or_wholly_on_the_near_side_earns_little(seed):
    assert earned(seed, -0.2, over=0.1) <= 0.09
    assert earned(seed, -0.2, over=-0.12) <= 0.09
    assert earned(seed, -0.2, tail=-0.02) <= 0.09

"""Requirements for HangRing's reward."""

from dataclasses import replace

import numpy as np
import pytest

from core.scene import Pose, Trace
from tasks.hardtoolbench.hang_ring import HANGS, SECTION, HangRing

TASK = HangRing(variation="wide")
SCENE = TASK.scene(3)
START = SCENE.state()
HANGING = (-HANGS, 0.0, -0.03)


def reward(at, rpy=(0.0, 0.0, 0.0), speed=0.0, touching=()):
    """The reward of a ring that ends at a place in the frame of the second peg."""
    pose = SCENE["peg_b"].pose @ Pose.xyz_rpy(at, rpy)
    end = replace(
        START, positions=pose.position[None], quaternions=pose.quaternion[None]
    )
    end = replace(end, linear_velocities=np.array([[0.0, 0.0, speed]]))
    flags = {
        (kind, one, "ring"): np.array([True, last]) for kind, one, last in touching
    }
    return float(TASK.reward(START, end, Trace.of(START, end, touching=flags)))


def test_a_ring_that_hangs_on_the_second_peg_is_done_when_it_is_let_go_and_rests():
    assert reward(HANGING, touching=[("tool", "prong", False)]) == 1.0
    assert reward(HANGING, touching=[("tool", "prong", True)]) == pytest.approx(0.6)
    assert reward(HANGING, speed=0.5) == pytest.approx(0.6)


@pytest.mark.parametrize("rpy", [(1.0, 0.0, 0.0), (0.0, 0.3, 0.4)])
def test_a_ring_may_hang_turned(rpy):
    assert reward(HANGING, rpy) == 1.0


@pytest.mark.parametrize(
    "touched", [("arm", "hand", False), ("tool", "left_finger", False)]
)
def test_a_ring_that_hand_arm_or_finger_touched_earns_nothing(touched):
    assert reward(HANGING, touching=[touched]) == 0.0


@pytest.mark.parametrize(
    "at",
    [(-0.13, 0.0, -0.03), (0.03, 0.0, -0.03), (-0.05, 0.06, -0.03), (-0.05, 0.0, 0.06)],
)
def test_a_ring_beside_the_peg_earns_little(at):
    assert 0.05 < reward(at) < 0.16


def test_a_ring_across_the_peg_or_on_the_table_does_not_hang():
    assert reward(HANGING, (0.0, 0.0, np.pi / 2)) < 0.16
    assert reward((-HANGS, 0.0, -0.15)) == 0.0


@pytest.mark.parametrize("seed", range(4))
def test_a_ring_that_stands_on_the_peg_or_is_held_above_it_does_not_hang(seed):
    """The peg must go through the hole of this layout's ring, which is up to 12 mm smaller than that of others."""
    scene = TASK.scene(seed)
    inner = TASK.draw(seed)("ring.inner", 0.04)
    start = scene.state()
    for height, hangs in (
        (-inner, True),
        (-inner - 0.0015, True),
        (inner + SECTION, False),
        (inner + 0.005, False),
    ):
        pose = scene["peg_b"].pose @ Pose.xyz_rpy((-HANGS, 0.0, height))
        end = replace(
            start, positions=pose.position[None], quaternions=pose.quaternion[None]
        )
        touching = {("body", "ring", "peg_b"): np.array([False, True])}
        assert (
            float(TASK.reward(start, end, Trace.of(start, end, touching=touching)))
            == 1.0
        ) == hangs, height


def test_the_way_to_the_second_peg_counts():
    earned = [reward((-0.3, -0.35 * (1 - share), 0.0)) for share in (0.0, 0.3, 0.6)]
    assert earned == sorted(earned)
    assert earned[0] < earned[-1]

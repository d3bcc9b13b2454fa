"""Motions for real arms: the same way as was simulated, smooth and within limits."""

import numpy as np
import pytest

from core.interfaces import RolloutSettings
from core.plugins import installed
from core.robot.kinematics import arm_of
from core.robot.trajectory import plan_task_motion
from plugins.results.workshop.motion import (
    APPROACH,
    SHARE,
    STEP_S,
    approach,
    cut,
    sample,
    to_csv,
)
from tests.support.panda import PANDA
from tests.support.solutions import literal

pytestmark = pytest.mark.slow

ARM = arm_of(PANDA)


def planned(name):
    task = installed().create("task", name)
    return plan_task_motion(literal(name).plan, task, RolloutSettings())


@pytest.mark.parametrize(
    "name",
    ["OneBook", "OpenLatch", "StopCart", "SweepCards", "TurnDisc", "SnatchCookie"],
)
def test_a_motion_keeps_to_the_way_and_to_the_limits(name):
    motion = planned(name)
    made = sample(motion.trajectory, ARM, 1000)
    there, _ = motion.trajectory.sample(made.times / made.slower - STEP_S)
    assert np.abs(made.positions - there).max() < 6e-4
    assert np.allclose(made.positions[0], motion.trajectory.arm[0], atol=1e-9)
    assert np.allclose(made.positions[-1], motion.trajectory.arm[-1], atol=1e-9)
    velocity, acceleration = made.loads(ARM)
    assert velocity.max() <= SHARE + 1e-3
    assert acceleration.max() <= SHARE + 1e-3
    assert made.slower == 1  # what is struck or thrown flies as it was simulated
    steps = np.diff(made.positions, axis=0) * 1000
    assert np.abs(steps - (made.velocities[1:] + made.velocities[:-1]) / 2).max() < 0.01
    assert (
        np.abs(np.diff(made.velocities, axis=0) * 1000 - made.accelerations[:-1])[
            :-1
        ].max()
        < 15
    )


def test_an_approach_is_slow_and_at_rest_at_both_ends():
    start = PANDA.home + np.linspace(-0.3, 0.3, 7)
    end = np.array(PANDA.home)
    made = approach(start, end, 0.04, ARM, 500)
    assert np.allclose(made.positions[[0, -1]], [start, end])
    assert np.allclose(made.velocities[[0, -1]], 0)
    assert np.allclose(made.accelerations[[0, -1]], 0)
    velocity, acceleration = made.loads(ARM)
    assert velocity.max() == pytest.approx(APPROACH, rel=0.01)
    assert acceleration.max() < SHARE
    assert len(approach(end, end, 0.04, ARM, 500).times) >= 1


def test_a_motion_cut_by_where_the_arm_rests():
    motion = planned("OneBook")
    cuts = [
        cut(motion.trajectory, motion.arrivals, instant, ARM)
        for instant in (0.1, 1.0, 1.4, 99)
    ]
    assert cuts[0] is None
    assert [made.duration for made in cuts[1:]] == pytest.approx(
        [
            max(at for at in motion.arrivals if at < instant)
            for instant in (1.0, 1.4, 99)
        ]
    )
    velocity, _ = sample(cuts[2], ARM, 1000).loads(ARM)
    assert velocity.max() <= SHARE


def test_files_have_every_sample():
    made = sample(planned("OneBook").trajectory, ARM, 100)
    lines = to_csv(made, PANDA).splitlines()
    assert len(lines) == len(made.times) + 1
    assert lines[0].split(",")[:2] == ["time_s", "panda_joint1_rad"]
    assert len(lines[1].split(",")) == 1 + 3 * 7 + 1

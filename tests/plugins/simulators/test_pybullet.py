"""What is PyBullet's own: its settings, and what they mean. What every engine must do is in test_conformance.py."""

import math

import numpy as np
import pytest

from core.conformance.worlds import BARE, Bodies, cube, end, film, move, stick, still
from core.errors import UserError
from core.interfaces import JointTrajectory, Rollout
from core.plugins import installed
from core.robot import FINGER_OPEN
from core.scene import table

pytest.importorskip("pybullet")


@pytest.mark.parametrize("time_step", [0.001, 0.004])
def test_tracking_does_not_depend_on_the_time_step(time_step):
    sims = installed().create("sim", "pybullet"), installed().create("sim", "pybullet", {"time_step": time_step})
    plan = [[0.6, 0.2, 0.3, 0, 0.3, 0], [0.6, -0.2, 0.3, 0, 0, 0.5]]
    bodies = table(), cube(at=(0.6, 0, 0.05))
    ours, theirs = (move(sim, plan, *bodies, tool=stick(0.25), record_hz=10) for sim in sims)
    length = min(len(film(ours).times), len(film(theirs).times))
    assert np.abs(film(ours).arm[:length] - film(theirs).arm[:length]).max() < 0.03
    np.testing.assert_allclose(end(ours).position("cube"), end(theirs).position("cube"), atol=0.03)


@pytest.mark.parametrize("time_step", [0.001, 0.002, 0.004])
@pytest.mark.parametrize("rate", [20.0, 50.0])
def test_joints_close_in_on_their_targets_at_the_tracking_rate(time_step, rate):
    sim = installed().create("sim", "pybullet", {"time_step": time_step, "tracking_rate": rate})
    arms = still().arm + np.array([[0.0], [0.002]]) * np.eye(7)[0]  # the first joint's target jumps
    jump = JointTrajectory(np.array([0.0, 1e-4]), arms, np.full(2, FINGER_OPEN))
    (outcome,) = sim.rollout(Bodies(), [Rollout(BARE, jump, settle_s=0.1, hold_s=0.1, record_hz=250)])
    times, left = film(outcome).times, arms[1, 0] - film(outcome).arm[:, 0]
    first, last = np.searchsorted(times, [0.0119, 0.0319])
    found = np.log(left[first] / left[last]) / (times[last] - times[first])
    assert found == pytest.approx(rate, rel=0.1)


@pytest.mark.parametrize(
    ("setting", "value"),
    [("time_step", 0), ("time_step", -0.001), ("time_step", math.nan), ("solver_iterations", 0), ("tracking_rate", 0)],
)
def test_numbers_that_make_no_sense(setting, value):
    with pytest.raises(UserError, match=setting):
        installed().create("sim", "pybullet", {setting: value})

"""The fingers of grippers."""

import numpy as np
import pytest

from core.plugins import installed
from core.robot.extents import fingers_of
from plugins.tools.mounting import finger_gap
from tests.support.panda import PANDA

UR5 = installed().create("robot", "ur5")


def test_the_fingers_of_the_data_sheet():
    """Each opens by 0.04 m, away from the other; tips are 0.113 m below the flange."""
    left, right = fingers_of(PANDA)
    for finger, side in ((left, 1), (right, -1)):
        np.testing.assert_allclose(
            finger.pose.position, (0, -side * 0.04, -0.0584), atol=1e-6
        )
        np.testing.assert_allclose(
            finger.pose.rotation.as_matrix(), np.diag([1, -1, -1]), atol=1e-6
        )
        np.testing.assert_array_equal(finger.opens, (0, side, 0))
        np.testing.assert_array_equal(finger.tip, (0, 0, 1))
        assert finger.place(finger.tip)[2] == pytest.approx(-0.113, abs=1e-3)
        assert finger.face(-finger.opens) == pytest.approx(0, abs=1e-4)
        assert side * finger.face(finger.opens) == pytest.approx(0.026, abs=1e-3)
    assert finger_gap(PANDA) == pytest.approx(2 * PANDA.opening_m, abs=1e-4)


def test_an_arm_without_a_gripper_has_no_fingers():
    assert fingers_of(UR5) == ()

"""How much of its torque a joint used."""

import numpy as np
import pytest

from core.plugins import installed
from core.robot.kinematics import arm_of
from core.values.torques import TorqueShare, find_hardest


def test_the_hardest_joint_is_named_with_its_share():
    hardest = find_hardest({"shoulder": 0.4, "elbow": 0.83, "wrist": 0.1})
    assert hardest == TorqueShare("elbow", 0.83)
    assert str(hardest) == "elbow used 83 % of its torque"
    assert hardest.is_high
    assert find_hardest({}) is None


def test_shares_are_of_each_joints_own_limit():
    arm = arm_of(installed().default_robot)
    shares = arm.share_torques(0.5 * arm.effort_limits)
    assert list(shares) == list(arm.robot.arm_joints)
    assert [*shares.values()] == pytest.approx([0.5] * len(shares))
    assert arm.share_torques(None) == {}


def test_a_joint_without_a_limit_has_no_share():
    arm = arm_of(installed().default_robot)
    limits = arm.effort_limits.copy()
    limits[0] = np.inf
    arm.effort_limits, kept = limits, arm.effort_limits
    try:
        assert len(arm.share_torques(np.ones(len(limits)))) == len(limits) - 1
    finally:
        arm.effort_limits = kept

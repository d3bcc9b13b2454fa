"""`ComponentTools` is tested with `tests/plugins/tools/test_boxes.py`."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.design import DesignError
from core.geometry import Pose
from plugins.tools.components import (
    MAX_NUMBER,
    check_keys,
    read_number,
    read_numbers,
    robot_names,
    rounded,
    rounded_rpy,
)
from tests.panda import PANDA

angles = st.one_of(
    st.floats(-10, 10), st.builds(lambda k, d: k * math.pi / 4 + d, st.integers(-8, 8), st.floats(-3e-5, 3e-5))
)


@given(st.tuples(angles, angles, angles))
def test_rounded_angles_are_the_same_turn_and_are_found_again(rpy):
    pose = Pose.xyz_rpy((0, 0, 0), rpy)
    written = rounded_rpy(pose)
    again = Pose.xyz_rpy((0, 0, 0), written)
    np.testing.assert_allclose(pose.matrix, again.matrix, atol=5e-5)
    assert rounded_rpy(again) == written


def test_whole_numbers_have_no_point():
    assert str(rounded([1.0, -0.0, 0.123456, -1e-9])) == "[1, 0, 0.12346, 0]"


@pytest.mark.parametrize("value", [None, "1", True, [1], {}, math.nan, math.inf, -math.inf, 10**400, 1001, 1e300])
def test_other_values_are_no_numbers(value):
    with pytest.raises(DesignError, match="here"):
        read_number(value, "here")
    with pytest.raises(DesignError, match="here"):
        read_numbers([0, 0, value], 3, "here")


def test_numbers_are_read():
    assert read_numbers([1, 2.5, -MAX_NUMBER], 3, "here") == [1.0, 2.5, -MAX_NUMBER]
    with pytest.raises(DesignError, match="here must be a list of 3 numbers, not a list of 2"):
        read_numbers([1, 2], 3, "here")


def test_unknown_keys_are_named():
    check_keys({"a": 1}, ("a", "b"), "here")
    with pytest.raises(DesignError, match=r"here has '\\ud800', which it can't have; possible: a, b"):
        check_keys({"\ud800": 1}, ("b", "a"), "here")


def test_a_robots_names_are_those_of_its_links_joints_and_mounts():
    assert {"tool_mount", "left_finger", "panda_link7", "panda_joint1"} <= robot_names(PANDA)
    assert robot_names(None) == {"tool_mount", "left_finger", "right_finger"}

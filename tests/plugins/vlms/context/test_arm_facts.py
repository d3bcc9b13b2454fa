from dataclasses import replace

import pytest

from core.geometry import Pose
from core.interfaces import RolloutSettings, Task
from core.plugins import installed
from plugins.vlms.context.arm_facts import describe_arm, segments
from tests.support.panda import ARM, PANDA

pytestmark = pytest.mark.slow

UR5 = installed().create("robot", "ur5")


def sheet(robot, *, engine="mujoco", gripper=False):
    return describe_arm(robot, Task.home, RolloutSettings(), engine, gripper)


def test_how_exact_the_arm_is_depends_on_the_engine():
    measured = PANDA.measured
    texts = [
        sheet(PANDA, engine=engine).exactness for engine in ("mujoco", "sapien", "mine")
    ]
    assert (
        f"Measured in mujoco: in motion it lags by up to {measured['mujoco']['lag_mm']:.2g} mm"
        in texts[0]
    )
    assert (
        f"presses with {measured['sapien']['push_n_per_mm']:.0f} N per mm, " in texts[1]
    )
    assert texts[2] == ""


def test_segments_take_the_time_of_the_motion():
    """Without limits the profile is a trapezoid: its peak is 1.25 times its mean."""
    slow = segments(ARM, Task.home, RolloutSettings(segment_s=3.0))
    assert [one.seconds for one in slow] == pytest.approx([3.0] * len(slow), rel=0.01)
    assert [one.peak for one in slow] == pytest.approx([1.25] * len(slow), rel=0.02)
    fast = {
        (one.direction, one.length): one
        for one in segments(ARM, Task.home, RolloutSettings())
    }
    assert (
        fast["forward", 0.4].seconds
        > fast["left", 0.4].seconds
        > fast["left", 0.1].seconds
    )
    assert fast["forward", 0.4].peak > 1.5
    assert "for 0.1 m" in sheet(PANDA).speed


def test_what_a_tool_meets_at_the_mount():
    rigid, gripper, six = sheet(PANDA), sheet(PANDA, gripper=True), sheet(UR5)
    assert rigid.clear
    assert rigid.bearers == ("panda_link7",)
    assert (
        "| panda_link7 | -0.044 to 0.044 | -0.088 to 0.054 | 0 to 0.055 |"
        in rigid.around
    )
    assert gripper.around.startswith(rigid.around)
    assert (
        "| left_finger | -0.011 to 0.011 | -0.066 to -0.04 | -0.113 to -0.059 |"
        in gripper.around
    )
    assert not six.clear  # its elbow is lower
    assert six.fingers == ()


def test_where_the_axes_of_the_fingers_point():
    left, right = sheet(PANDA, gripper=True).fingers
    assert left == (
        "`left_finger`: origin at (0, -0.04, -0.0584), x points to the front, y to the right, z down; "
        "the tip is 0.113 m below."
    )
    assert right.startswith("`right_finger`: origin at (0, 0.04, -0.0584), x points")
    askew = replace(
        PANDA.gripper, mount=PANDA.gripper.mount @ Pose.xyz_rpy((0, 0, 0), (0, 0, 0.5))
    )
    turned = sheet(replace(PANDA, gripper=askew)).fingers[0]
    axes = "x points along (0.878, -0.479, 0), y along (-0.479, -0.878, 0), z down;"
    assert axes in turned


def test_the_wrists_torque_and_stiffness():
    yields = sheet(PANDA, engine="mujoco")
    assert yields.turns.endswith(", with 12 N m")
    assert (
        f"turned back, it turns with {PANDA.measured['mujoco']['turn_nm_per_rad']:.0f} N m per rad. "
        in yields.exactness
    )
    assert (
        "turned back, it turns with full torque at once. "
        in sheet(PANDA, engine="pybullet").exactness
    )

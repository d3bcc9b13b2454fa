"""What is said of designs before they are tried is what the rules, the kinematics and the rollout would say."""

import re

import numpy as np
import pytest

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Candidate, Component, Tool
from core.designs.review import review
from core.designs.rules import MAX_COMPONENTS
from core.geometry import Box, Pose
from core.interfaces import RolloutSettings
from core.robot.trajectory import plan_motion
from tasks.bring_cube import BringCube
from tests.panda import ARM, on_panda

TASK = on_panda(BringCube())  # home at (0.5, 0, 0.5)
HOME = (0.5, 0.0, 0.5)


def rod(length=0.2, mount=RIGID_MOUNT):
    return Component("rod", mount, Pose(np.array([0.0, 0.0, -length / 2])), Box((0.02, 0.04, length)))


def reviewed(*waypoints, tool=None, settings=None, **more):
    tool = tool or Tool((rod(),), name="a rod")
    candidate = Candidate(tool, np.array([list(waypoint) for waypoint in waypoints]), **more)
    return review([candidate], TASK, 0, settings or RolloutSettings())


def test_a_reason_stays_in_its_line():
    text = reviewed((*HOME, 0, 0, 0), problem="the representation failed:\n- Strategy 2: all is well")
    assert "rejected: the representation failed: - Strategy 2: all is well" in text


def test_a_tool_at_home():
    text = reviewed((*HOME, 0, 0, 0), strategy=4)
    assert text.startswith("- Strategy 5 (a rod):\n  - 0.005 kg; ")
    assert "rod: 0.490 to 0.510, -0.020 to 0.020, 0.300 to 0.500" in text


def test_a_plan_within_reach():
    text = reviewed((0.5, 0.1, 0.4, 0, 0, 0), (0.5, 0.1, 0.4, 0, np.pi / 2, 0))
    assert "every waypoint is reached within 1 mm and 0.01 rad" in text
    assert "rejected" not in text


def test_waypoints_out_of_reach_are_named_with_what_the_arm_reaches_instead():
    plan = np.array([[0.5, 0, 0.4, 0, 0, 0], [1.3, 0, 0.4, 0, 0, 0]])
    motion = plan_motion(plan, TASK.home, ARM)
    text = reviewed(*plan)
    assert f"waypoint 2 is missed by {motion.ik_error_m * 1000:.0f} mm" in text
    assert "waypoint 1 is missed" not in text
    x, y, z = ARM.forward(motion.trajectory.arm[-1]).position
    assert f"the end-effector gets to ({x:.3f}, {y:.3f}, {z:.3f})" in text


def test_a_way_that_can_not_be_followed_between_waypoints_that_can():
    """From one side of the base to the other, straight through it."""
    text = reviewed((0.1, 0.5, 0.4, 0, 0, 0), (0.1, -0.5, 0.4, 0, 0, 0))
    assert re.search(r"between waypoints the arm leaves the straight way by up to \d+ mm", text)


def test_what_a_rollout_would_reject():
    long = Tool((rod(0.5),))
    back = (0.3, 0, 0.5, 0, 1.9, 0)
    assert re.search(
        r"rejected: the tool's 'rod' is \d+ mm inside the arm's '\w+' .* waypoint 1", reviewed(back, tool=long)
    )
    assert "inside" not in reviewed(back, tool=long, settings=RolloutSettings(penetration="ignore"))
    assert "rejected: the tool's" not in reviewed(back, tool=long, settings=RolloutSettings(penetration="warn"))
    assert "0.5 s, rejected: more than 0.1 s" in reviewed((*HOME, 0, 0, 0), settings=RolloutSettings(max_motion_s=0.1))


def test_problems_are_said_once_for_a_tool_and_for_each_plan():
    tool = Tool((rod(),))
    broken = [Candidate(tool, np.zeros((0, 6)), action=n, problem="it is too heavy") for n in range(3)]
    assert review(broken, TASK, 0, RolloutSettings()).count("rejected: it is too heavy") == 1
    plans = [
        Candidate(tool, np.array([[*HOME, 0, 0, 0]])),
        Candidate(tool, np.zeros((0, 6)), action=1, problem="too far"),
    ]
    text = review(plans, TASK, 0, RolloutSettings())
    assert "plan 2: rejected: too far" in text
    assert "plan 1: 0.5 s" in text
    unread = [Candidate(None, np.zeros((0, 6)), problem="it is a list")]
    assert review(unread, TASK, 0, RolloutSettings()) == "- Strategy 1:\n  - rejected: it is a list"


def test_attachments_hang_from_the_fingers():
    tips = Tool(
        tuple(Component(f"tip{n}", mount, Pose(), Box((0.01, 0.01, 0.01))) for n, mount in enumerate(GRIPPER_MOUNTS)),
        True,
    )
    text = reviewed((*HOME, 0, 0, 0, 0.0), (*HOME, 0, 0, 0, 1.0), tool=tips)
    assert "tip0: 0.495 to 0.505, -0.045 to -0.035, " in text
    assert "tip1: 0.495 to 0.505, 0.035 to 0.045, " in text


@pytest.mark.slow
def test_a_tool_of_far_too_many_components_costs_no_time():
    many = Tool(tuple(Component(f"c{n}", RIGID_MOUNT, Pose(), Box((0.01, 0.01, 0.01))) for n in range(5000)))
    text = reviewed((*HOME, 0, 0, 0), tool=many, problem="too many boxes")
    assert text.count(" to 0.505, ") == MAX_COMPONENTS

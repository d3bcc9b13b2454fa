import numpy as np
import pytest

from core.design import Tool
from core.robot.kinematics import link_frames, robot_model
from tests.support.panda import PANDA

RNG = np.random.default_rng(3)


@pytest.mark.parametrize("gripper", [True, False])
def test_no_joint_moves_a_link_by_more_than_the_reach(gripper):
    reach = robot_model(PANDA, Tool(gripper=gripper)).reach
    arm = RNG.uniform(-2, 2, (200, 7))
    for joint in range(7):
        turned = arm.copy()
        turned[:, joint] += 1e-4
        tool, fingers = Tool(gripper=gripper), np.zeros((200, 2))
        before, after = (
            link_frames(PANDA, tool, joints, fingers) for joints in (arm, turned)
        )
        for link in before:
            moved = np.linalg.norm(after[link][1] - before[link][1], axis=1)
            assert (moved <= reach * 1e-4).all()

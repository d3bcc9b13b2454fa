import numpy as np
import pinocchio as pin
import pytest

from core.design import Tool
from core.robot.description import assemble
from core.robot.kinematics import link_frames, robot_model
from tests.panda import ARM_JOINTS, FINGER_JOINTS, PANDA

RNG = np.random.default_rng(3)


@pytest.mark.parametrize("gripper", [True, False])
def test_links_are_where_pinocchio_has_them(gripper):
    model = pin.buildModelFromXML(assemble(PANDA, Tool(gripper=gripper), visuals=False))
    data = model.createData()
    arm, fingers = RNG.uniform(-2, 2, (5, 7)), RNG.uniform(0, 0.04, (5, 2))
    found = link_frames(PANDA, Tool(gripper=gripper), arm, fingers)
    for t in range(5):
        q = pin.neutral(model)
        for name, value in zip((*ARM_JOINTS, *FINGER_JOINTS), (*arm[t], *fingers[t]), strict=True):
            if model.existJointName(name):
                q[model.joints[model.getJointId(name)].idx_q] = value
        pin.framesForwardKinematics(model, data, q)
        bodies = [n for n, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY]
        assert {model.frames[n].name for n in bodies} == set(found)
        for n in bodies:
            rotations, positions = found[model.frames[n].name]
            assert np.allclose(rotations[t], data.oMf[n].rotation, atol=1e-12)
            assert np.allclose(positions[t], data.oMf[n].translation, atol=1e-12)


@pytest.mark.parametrize("gripper", [True, False])
def test_no_joint_moves_a_link_by_more_than_the_reach(gripper):
    reach = robot_model(PANDA, Tool(gripper=gripper)).reach
    arm = RNG.uniform(-2, 2, (200, 7))
    for joint in range(7):
        turned = arm.copy()
        turned[:, joint] += 1e-4
        tool, fingers = Tool(gripper=gripper), np.zeros((200, 2))
        before, after = (link_frames(PANDA, tool, joints, fingers) for joints in (arm, turned))
        for link in before:
            moved = np.linalg.norm(after[link][1] - before[link][1], axis=1)
            assert (moved <= reach * 1e-4).all()

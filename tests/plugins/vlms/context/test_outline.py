"""The URDF that is shown is enough to build the robot's model again."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from core.design import Tool
from core.geometry import Pose
from core.plugins import installed
from core.robot.description import assemble
from plugins.vlms.context.outline import shorten_urdf
from tasks.clean_table import CleanTable
from tests.support.panda import PANDA, on_panda

UR5 = installed().create("robot", "ur5")
BROOM = installed().create("tool", "rlbench").given(on_panda(CleanTable()))

MOUNTED = [
    pytest.param(PANDA, Tool(), id="rigid"),
    pytest.param(PANDA, Tool(gripper=True), id="gripper"),
    pytest.param(PANDA, BROOM, id="broom"),
    pytest.param(
        replace(UR5, base=Pose.xyz_rpy((0.1, -0.2, 0), (0, 0, 0.5))),
        BROOM,
        id="six joints, elsewhere",
    ),
]


def frames(urdf):
    model = pin.buildModelFromXML(urdf)
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.linspace(0.1, 0.9, model.nq))
    return model, {
        f.name: data.oMf[i].homogeneous
        for i, f in enumerate(model.frames)
        if f.type == pin.FrameType.BODY
    }


@pytest.mark.parametrize(("robot", "tool"), MOUNTED)
def test_frames_and_limits_are_those_of_the_description(robot, tool):
    text = shorten_urdf(robot, tool)
    (short, shown), (whole, placed) = (
        frames(text),
        frames(assemble(robot, tool, visuals=False)),
    )
    assert shown.keys() == placed.keys()
    for name, pose in shown.items():
        np.testing.assert_allclose(pose, placed[name], atol=1e-9)
    for name in ("lowerPositionLimit", "upperPositionLimit", "velocityLimit"):
        np.testing.assert_allclose(getattr(short, name), getattr(whole, name))
    assert text.count("<box") >= len(tool.components)
    for noise in ("inertial", "mesh", "visual", "dynamics"):
        assert f"<{noise}" not in text

"""The robot as short URDF: the same frames and limits as the whole one, and boxes around its links."""

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree

from core.design import Tool
from core.robot.description import assemble
from core.robot.outline import outline
from core.robot.solids import robot_solids
from plugins.tools.rlbench import broom

TOOLS = [
    pytest.param(Tool(), id="rigid"),
    pytest.param(Tool(gripper=True), id="gripper"),
    pytest.param(broom(), id="broom"),
]


def frames(urdf):
    model = pin.buildModelFromXML(urdf if "effort=" in urdf else urdf.replace("<limit ", '<limit effort="1" '))
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.linspace(0.1, 0.9, model.nq))
    placed = {f.name: data.oMf[i].homogeneous for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY}
    return model, placed


@pytest.mark.parametrize("tool", TOOLS)
def test_frames_and_limits_are_those_of_the_whole_description(tool):
    (short, shown), (whole, placed) = frames(outline(tool)), frames(assemble(tool, visuals=False))
    assert list(shown) == list(placed)
    for name, pose in placed.items():
        np.testing.assert_allclose(shown[name], pose, atol=3e-4)
    for name in ("lowerPositionLimit", "upperPositionLimit", "velocityLimit"):
        np.testing.assert_allclose(getattr(short, name), getattr(whole, name), atol=1e-4)


@pytest.mark.parametrize("gripper", [False, True])
def test_a_links_box_is_around_its_shapes(gripper):
    robot = etree.fromstring(outline(Tool(gripper=gripper)))
    for solid in robot_solids(gripper):
        center, half = solid.bounds()
        (collision,) = robot.findall(f"link[@name='{solid.name}']/collision")
        origin, box = collision.find("origin"), collision.find("geometry/box")
        assert origin.get("rpy") is None
        at, size = (np.array([float(word) for word in text.split()]) for text in (origin.get("xyz"), box.get("size")))
        assert np.all(np.abs(center - at) + half <= size / 2 + 0.0015)


def test_a_tool_keeps_its_boxes_and_nothing_is_there_that_a_reader_does_not_need():
    robot = etree.fromstring(outline(broom()))
    sizes = [box.get("size") for box in robot.iterfind("link/collision/geometry/box")][-2:]
    assert sizes == ["0.4294 0.011 0.011", "0.0375 0.2625 0.0375"]
    tags = {element.tag for element in robot.iter()} - {"robot", "link", "joint"}
    assert tags == {"collision", "origin", "geometry", "box", "parent", "child", "axis", "limit"}

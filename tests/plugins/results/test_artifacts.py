import numpy as np
import pinocchio as pin
import pytest
import trimesh
from lxml import etree

from core.design import Component, Fixture, Tool, ToolJoint
from core.geometry import Box, Pose
from core.interfaces import Task, Waypoints
from core.robot.kinematics import arm_of
from core.robot.trajectory import plan_motion
from plugins.results.artifacts import copied, save_files, tool_mesh
from tests.support.panda import FINGER_OPEN, PANDA
from tests.support.shapes import bowl

FLAP = ToolJoint("hinge", (1, 0, 0), -1, 1)


def box(name, parent, at, size, rpy=(0, 0, 0)):
    return Component(name, parent, Pose.xyz_rpy(at, rpy), Box(size))


def test_of_two_meshes_of_one_name_both_are_there(tmp_path):
    for arm in ("left", "right"):
        (tmp_path / arm).mkdir()
        (tmp_path / arm / "link.stl").write_text(arm)
    names = [
        copied(tmp_path / arm / "link.stl", tmp_path / "out")
        for arm in ("left", "right", "left", "right")
    ]
    assert names == ["meshes/link.stl", "meshes/link_2.stl"] * 2
    assert (tmp_path / "out" / names[1]).read_text() == "right"


def test_a_tool_is_one_closed_body_in_millimetres():
    tool = Tool(
        (
            box("shaft", "tool_mount", (0, 0, -0.05), (0.02, 0.02, 0.1)),
            box("blade", "shaft", (0.06, 0, 0), (0.1, 0.02, 0.02)),
        )
    )
    mesh = tool_mesh(tool, FINGER_OPEN)
    assert mesh.is_volume
    assert mesh.body_count == 1
    np.testing.assert_allclose(mesh.bounds, [[-10, -10, -100], [110, 10, 0]], atol=0.03)
    assert mesh.volume == pytest.approx(1e9 * 2 * 0.02 * 0.02 * 0.1, rel=0.01)


def test_a_tool_of_any_form_takes_its_meshes_along(tmp_path):
    head = Component(
        "head", "tool_mount", Pose.xyz_rpy((0.0, 0.0, -0.08)), bowl(0.07, 0.01)
    )
    flap = Component(
        "flap",
        "head",
        Pose.xyz_rpy((0.0, 0.0, -0.085)),
        Box((0.02, 0.02, 0.02)),
        joint=FLAP,
    )
    tool = Tool((head, flap), fixture=Fixture(Tool((head,)), Pose()))
    plan = np.array([[0.5, 0.0, 0.4, 0.0, 0.0, 0.0]])
    motion = plan_motion(Waypoints(plan), Task.home, arm_of(PANDA))
    save_files(tool, PANDA, motion, tmp_path)
    for name in ("tool.urdf", "robot.urdf"):
        robot = etree.parse(tmp_path / name)
        files = {mesh.get("filename") for mesh in robot.iter("mesh")}
        assert files
        assert all((tmp_path / file).is_file() for file in files), name
        assert robot.find("joint[@name='flap_joint']").get("type") == "revolute"
    for name in ("tool.stl", "fixture.stl"):
        assert trimesh.load_mesh(tmp_path / name).is_watertight
    assert pin.buildModelFromUrdf(str(tmp_path / "robot.urdf")).nq == 8


def test_a_pair_of_attachments_is_printed_side_by_side():
    fingers = ("left_finger", 1), ("right_finger", -1)
    pads = (
        box(f"pad_{mount}", mount, (0, side * 0.0075, 0.07), (0.02, 0.015, 0.04))
        for mount, side in fingers
    )
    mesh = tool_mesh(Tool(tuple(pads), gripper=True), FINGER_OPEN)
    np.testing.assert_allclose(mesh.bounds, [[-10, -55, 50], [10, 55, 90]], atol=0.03)
    assert mesh.body_count == 2

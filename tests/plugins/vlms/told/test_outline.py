"""The table of a robot's links is enough to build its model again."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from lxml import etree

from core.design import Tool
from core.geometry import Pose
from core.plugins import installed
from core.robot.description import assemble, assembled
from core.robot.solids import robot_solids
from plugins.vlms.told.outline import HEAD, link_extents, outline
from tasks.clean_table import CleanTable
from tests.panda import PANDA

UR5 = installed().create("robot", "ur5")
BROOM = installed().create("tool", "rlbench").given(CleanTable())

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


def rows(robot, tool):
    """The rows of the table by link, each as a dictionary with the parent."""
    lines = outline(robot, tool).splitlines()[2:]
    found = [
        dict(
            zip(
                HEAD, [cell.strip() for cell in line.strip("|").split("|")], strict=True
            )
        )
        for line in lines
    ]
    return {
        row[HEAD[0]].partition(" on ")[0]: row
        | {"parent": row[HEAD[0]].partition(" on ")[2]}
        for row in found
    }


def rebuilt(robot, tool):
    """A URDF made of nothing but the table."""
    made = etree.Element("robot", name="again")
    for name, row in rows(robot, tool).items():
        etree.SubElement(made, "link", name=name)
        if not row["parent"]:
            continue
        motion, *words = row["joint"].split()
        kind = {"turns": "revolute", "slides": "prismatic", "fixed": "fixed"}[motion]
        joint = etree.SubElement(made, "joint", name=f"to_{name}", type=kind)
        etree.SubElement(joint, "parent", link=row["parent"])
        etree.SubElement(joint, "child", link=name)
        etree.SubElement(joint, "origin", xyz=row["xyz"], rpy=row["rpy"])
        if words:
            sign = -1 if words[-1].startswith("-") else 1
            axis = sign * np.eye(3)["xyz".index(words[-1][-1])]
            etree.SubElement(joint, "axis", xyz=" ".join(map(str, axis)))
            lower, upper = row["range"].split(" to ")
            etree.SubElement(
                joint,
                "limit",
                lower=lower,
                upper=upper,
                velocity=row["speed"],
                effort="1",
            )
    return etree.tostring(made, encoding="unicode")


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
    (short, shown), (whole, placed) = (
        frames(rebuilt(robot, tool)),
        frames(assemble(robot, tool, visuals=False)),
    )
    # It has no shape, and bears nothing.
    assert set(placed) - set(shown) <= {"panda_hand_tcp"}
    for name, pose in shown.items():
        np.testing.assert_allclose(pose, placed[name], atol=3e-4)
    for name in ("lowerPositionLimit", "upperPositionLimit", "velocityLimit"):
        np.testing.assert_allclose(
            getattr(short, name), getattr(whole, name), atol=1e-4
        )


def box(row):
    return [
        np.array([float(word) for word in corner.split()])
        for corner in row[HEAD[-1]].split(" to ")
    ]


@pytest.mark.parametrize("gripper", [False, True])
def test_a_links_box_is_around_its_shapes(gripper):
    shown = rows(PANDA, Tool(gripper=gripper))
    for solid in robot_solids(PANDA, gripper):
        (low, high), (center, half) = box(shown[solid.name]), solid.bounds()
        assert np.all(low <= center - half + 0.001)
        assert np.all(high >= center + half - 0.001)
    assert shown["panda_link8"][HEAD[-1]] == "-"


def test_an_axis_that_is_not_given_is_x():
    root = etree.fromstring(PANDA.urdf)
    joint = root.find("joint[@name='panda_joint1']")
    joint.remove(joint.find("axis"))
    made = replace(PANDA, urdf=etree.tostring(root, encoding="unicode"))
    assert rows(made, Tool())["panda_link1"]["joint"] == "turns about x"


def test_a_tool_keeps_its_boxes():
    shown, joints = rows(PANDA, BROOM), assembled(PANDA, BROOM).joints
    for component in BROOM.components:
        low, high = box(shown[component.name])
        np.testing.assert_allclose(high - low, component.shape.size, atol=2e-4)
        np.testing.assert_allclose(high + low, 0, atol=1e-9)
        origin = [float(number) for number in shown[component.name]["xyz"].split()]
        np.testing.assert_allclose(origin, joints[component.name].origin.xyz, atol=1e-4)


def vertices(link, pose=None):
    """All vertices of a link's collision shapes, with the link at ``pose``."""
    points = []
    for part in link.collisions:
        mesh = (
            trimesh.load_mesh(part.shape)
            if isinstance(part.shape, Path)
            else part.shape.to_trimesh()
        )
        points.append(((pose or Pose()) @ part.origin.pose).apply(mesh.vertices))
    return np.concatenate(points) if points else np.empty((0, 3))


def test_links_by_themselves():
    extents = link_extents(PANDA, True)
    for name, link in assembled(PANDA, Tool(gripper=True)).links.items():
        points = vertices(link)
        assert (name in extents) == bool(len(points))
        if len(points):
            np.testing.assert_allclose(
                extents[name], (points.min(axis=0), points.max(axis=0)), atol=1e-6
            )

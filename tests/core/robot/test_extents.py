"""The space that links take, compared with the corners of their meshes at Pinocchio's poses, and the table of it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from lxml import etree

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Tool
from core.geometry import Pose
from core.plugins import installed
from core.robot.description import assemble, assembled
from core.robot.extents import GRIPPER, HEAD, extents_at_home, fingers_of, link_extents, outline
from core.robot.kinematics import arm_of
from core.robot.solids import robot_solids
from plugins.tools.given import broom
from plugins.tools.mounting import finger_gap
from tests.panda import PANDA

HOMES = [Pose(np.array(at)) for at in ((0.5, 0.0, 0.5), (0.4, -0.2, 0.2), (0.4, 0.0, 0.3))]
UR5 = installed().create("robot", "ur5")
ROBOTS = [
    pytest.param(PANDA, False, id="rigid"),
    pytest.param(PANDA, True, id="gripper"),
    pytest.param(UR5, False, id="six joints"),
    pytest.param(replace(UR5, base=Pose.xyz_rpy((0.1, -0.1, 0.05), (0, 0, 0.4))), False, id="elsewhere"),
]


def corners(link, pose=None):
    """All vertices of a link's collision shapes, with the link at ``pose``."""
    points = []
    for part in link.collisions:
        mesh = trimesh.load_mesh(part.shape) if isinstance(part.shape, Path) else part.shape.to_trimesh()
        points.append(((pose or Pose()) @ part.origin.pose).apply(mesh.vertices))
    return np.concatenate(points) if points else np.empty((0, 3))


def frames_at(robot, gripper, home):
    """The poses of links in the frame of the mount, the fingers open."""
    model = pin.buildModelFromXML(assemble(robot, Tool(gripper=gripper), visuals=False))
    data = model.createData()
    joints = arm_of(robot).home_for(home)
    pin.framesForwardKinematics(model, data, np.r_[joints, [robot.opening_m] * (2 if gripper else 0)])
    mount = data.oMf[model.getFrameId(RIGID_MOUNT)]
    bodies = [(i, frame.name) for i, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY]
    return {name: Pose.from_matrix(mount.actInv(data.oMf[i]).homogeneous) for i, name in bodies}


@pytest.mark.parametrize(("robot", "gripper"), ROBOTS)
@pytest.mark.parametrize("home", HOMES)
def test_around_the_mount_at_home(robot, gripper, home):
    frames, found = frames_at(robot, gripper, home), extents_at_home(robot, gripper, home)
    seen = set()
    for name, link in assembled(robot, Tool(gripper=gripper)).links.items():
        points = corners(link, frames[name])
        if not len(points):
            continue
        low, high = points.min(axis=0), points.max(axis=0)
        own = name if name in found else GRIPPER if "hand" in name else None
        if own is None:  # far from the mount
            assert np.linalg.norm(np.maximum(np.maximum(low, -high), 0.0)) > 0.3
            continue
        np.testing.assert_allclose(found[own][0], low, atol=1e-5)
        np.testing.assert_allclose(found[own][1], high, atol=1e-5)
        seen.add(own)
    assert seen == set(found)
    assert ({*GRIPPER_MOUNTS, GRIPPER} <= seen) == gripper
    assert set(robot.near_mount) & seen


def test_links_by_themselves():
    extents = link_extents(PANDA, True)
    for name, link in assembled(PANDA, Tool(gripper=True)).links.items():
        points = corners(link)
        assert (name in extents) == bool(len(points))
        if len(points):
            np.testing.assert_allclose(extents[name], (points.min(axis=0), points.max(axis=0)), atol=1e-6)


def test_the_fingers_of_the_data_sheet():
    """Each opens by 0.04 m, away from the other; tips are 0.113 m below the flange."""
    left, right = fingers_of(PANDA)
    for finger, side in ((left, 1), (right, -1)):
        np.testing.assert_allclose(finger.pose.position, (0, -side * 0.04, -0.0584), atol=1e-6)
        np.testing.assert_allclose(finger.pose.rotation.as_matrix(), np.diag([1, -1, -1]), atol=1e-6)
        np.testing.assert_array_equal(finger.opens, (0, side, 0))
        np.testing.assert_array_equal(finger.tip, (0, 0, 1))
        assert finger.place(finger.tip)[2] == pytest.approx(-0.113, abs=1e-3)
        assert finger.face(-finger.opens) == pytest.approx(0, abs=1e-4)
        assert side * finger.face(finger.opens) == pytest.approx(0.026, abs=1e-3)
    assert finger_gap(PANDA) == pytest.approx(2 * PANDA.opening_m, abs=1e-4)


def test_an_arm_without_a_gripper_has_no_fingers():
    assert fingers_of(UR5) == ()


# --- the table ------------------------------------------------------------------------------------------------------

MOUNTED = [
    pytest.param(PANDA, Tool(), id="rigid"),
    pytest.param(PANDA, Tool(gripper=True), id="gripper"),
    pytest.param(PANDA, broom(), id="broom"),
    pytest.param(replace(UR5, base=Pose.xyz_rpy((0.1, -0.2, 0), (0, 0, 0.5))), broom(), id="six joints, elsewhere"),
]


def rows(robot, tool):
    """The rows of the table by link, each as a dictionary with the parent."""
    lines = outline(robot, tool).splitlines()[2:]
    found = [dict(zip(HEAD, [cell.strip() for cell in line.strip("|").split("|")], strict=True)) for line in lines]
    return {row[HEAD[0]].partition(" on ")[0]: row | {"parent": row[HEAD[0]].partition(" on ")[2]} for row in found}


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
            etree.SubElement(joint, "limit", lower=lower, upper=upper, velocity=row["speed"], effort="1")
    return etree.tostring(made, encoding="unicode")


def frames(urdf):
    model = pin.buildModelFromXML(urdf)
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.linspace(0.1, 0.9, model.nq))
    return model, {f.name: data.oMf[i].homogeneous for i, f in enumerate(model.frames) if f.type == pin.FrameType.BODY}


@pytest.mark.parametrize(("robot", "tool"), MOUNTED)
def test_frames_and_limits_are_those_of_the_description(robot, tool):
    (short, shown), (whole, placed) = frames(rebuilt(robot, tool)), frames(assemble(robot, tool, visuals=False))
    assert set(placed) - set(shown) <= {"panda_hand_tcp"}  # it has no shape, and bears nothing
    for name, pose in shown.items():
        np.testing.assert_allclose(pose, placed[name], atol=3e-4)
    for name in ("lowerPositionLimit", "upperPositionLimit", "velocityLimit"):
        np.testing.assert_allclose(getattr(short, name), getattr(whole, name), atol=1e-4)


def box(row):
    return [np.array([float(word) for word in corner.split()]) for corner in row[HEAD[-1]].split(" to ")]


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
    shown, joints = rows(PANDA, broom()), assembled(PANDA, broom()).joints
    for component in broom().components:
        low, high = box(shown[component.name])
        np.testing.assert_allclose(high - low, component.shape.size, atol=2e-4)
        np.testing.assert_allclose(high + low, 0, atol=1e-9)
        origin = [float(number) for number in shown[component.name]["xyz"].split()]
        np.testing.assert_allclose(origin, joints[component.name].origin.xyz, atol=1e-4)

"""The space that links take, compared with the corners of their meshes at Pinocchio's poses."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Tool
from core.geometry import Pose
from core.plugins import installed
from core.robot.description import assemble, assembled
from core.robot.extents import fingers_of, link_extents
from core.robot.kinematics import arm_of
from plugins.tools.mounting import finger_gap
from plugins.vlms.told.outline import GRIPPER, extents_at_home
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

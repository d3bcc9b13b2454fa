"""The space that links take, compared with the corners of their meshes at Pinocchio's poses."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from core.design import Tool
from core.geometry import Pose
from core.plugins import installed
from core.robot.description import assembled
from core.robot.extents import fingers_of, link_extents
from plugins.tools.mounting import finger_gap
from tests.panda import PANDA

UR5 = installed().create("robot", "ur5")


def corners(link, pose=None):
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
        points = corners(link)
        assert (name in extents) == bool(len(points))
        if len(points):
            np.testing.assert_allclose(
                extents[name], (points.min(axis=0), points.max(axis=0)), atol=1e-6
            )


def test_the_fingers_of_the_data_sheet():
    """Each opens by 0.04 m, away from the other; tips are 0.113 m below the flange."""
    left, right = fingers_of(PANDA)
    for finger, side in ((left, 1), (right, -1)):
        np.testing.assert_allclose(
            finger.pose.position, (0, -side * 0.04, -0.0584), atol=1e-6
        )
        np.testing.assert_allclose(
            finger.pose.rotation.as_matrix(), np.diag([1, -1, -1]), atol=1e-6
        )
        np.testing.assert_array_equal(finger.opens, (0, side, 0))
        np.testing.assert_array_equal(finger.tip, (0, 0, 1))
        assert finger.place(finger.tip)[2] == pytest.approx(-0.113, abs=1e-3)
        assert finger.face(-finger.opens) == pytest.approx(0, abs=1e-4)
        assert side * finger.face(finger.opens) == pytest.approx(0.026, abs=1e-3)
    assert finger_gap(PANDA) == pytest.approx(2 * PANDA.opening_m, abs=1e-4)


def test_an_arm_without_a_gripper_has_no_fingers():
    assert fingers_of(UR5) == ()

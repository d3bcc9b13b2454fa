"""Descriptions are mended as told."""

import numpy as np
import pinocchio as pin
import pytest

from core.geometry import Cylinder, Pose
from core.values.descriptions import Inertial
from core.values.urdf import read_description
from plugins.robots.descriptions import Mending


def mending():
    return Mending("ur_description/urdf/ur5_robot.urdf")


def test_dropped_links_are_gone_with_their_joints():
    text = mending().drop("world", "tool0", "ee_link", "base").text()
    for gone in ("world", "tool0", "ee_link", "gazebo", "transmission", "<!--"):
        assert gone not in text
    assert pin.buildModelFromXML(text).nq == 6


def test_what_is_not_there_is_named():
    with pytest.raises(LookupError, match="no link 'hand'"):
        mending().drop("hand")


def test_inertias_and_limits_are_replaced():
    moments = (0.1, 0.01, 0.02, 0.2, 0.03, 0.25)
    mended = mending().drop("world").weigh({"wrist_3_link": Inertial(2.0, (0.1, 0.2, 0.3), moments)})
    model = pin.buildModelFromXML(mended.limit({"elbow_joint": {"upper": 1.5, "velocity": 0.5}}).text())
    last = model.inertias[model.njoints - 1]
    assert last.mass == 2.0
    np.testing.assert_allclose(last.lever, (0.1, 0.2, 0.3))
    np.testing.assert_allclose(last.inertia[np.triu_indices(3)], moments)
    elbow = model.getJointId("elbow_joint") - 1
    assert (model.lowerPositionLimit[elbow], model.upperPositionLimit[elbow]) == pytest.approx((-np.pi, 1.5))
    assert model.velocityLimit[elbow] == 0.5


def test_endless_joints_get_ends():
    kinova = Mending("kinova_description/robots/kinova.urdf")
    assert pin.buildModelFromXML(kinova.text()).nq == 9  # two numbers for each that has no ends
    kinova.limit({f"j2s6s200_joint_{i}": {"lower": -3.0, "upper": 3.0} for i in (1, 4, 6)})
    model = pin.buildModelFromXML(kinova.text())
    assert model.nq == 6
    assert model.upperPositionLimit[0] == 3.0


def test_collision_shapes_are_replaced(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    mended = mending().hull({"base_link": "ur_description/meshes/ur5/collision/base.stl"})
    mended.cover("wrist_3_link", Cylinder(0.03, 0.02), Pose(np.array([0.0, 0.1, 0.0])))
    links = read_description(mended.text().encode(), tmp_path / "ur5.urdf").links
    (mesh,) = links["base_link"].collisions
    assert mesh.shape.is_relative_to(tmp_path)
    assert mesh.shape.suffix == ".stl"
    (collision,) = links["wrist_3_link"].collisions
    assert collision.origin.xyz == (0, 0.1, 0)
    assert collision.shape == Cylinder(0.03, 0.02)

"""Descriptions are mended as told."""

from core.geometry import Cylinder
from core.values.descriptions import Inertial, Origin, RobotShape
from plugins.robots.example_robots import mend

UR5 = "ur_description/urdf/ur5_robot.urdf"
MOMENTS = (0.1, 0.01, 0.02, 0.2, 0.03, 0.25)


def arm(file=UR5, **changes):
    return mend(file, **changes)


def test_dropped_links_are_gone_with_their_joints():
    gone = {"world", "tool0", "ee_link", "base"}
    left = arm(drop=gone)
    assert not gone & {*left.links, *left.joints}
    assert sum(joint.kind == "revolute" for joint in left.joints.values()) == 6


def test_inertias_and_limits_are_replaced():
    own = (2.0, (0.1, 0.2, 0.3), MOMENTS)
    new = arm(
        inertials={"wrist_3_link": own},
        limits={"elbow_joint": {"upper": 1.5, "velocity": 0.5}},
    )
    assert new.links["wrist_3_link"].inertial == Inertial(*own)
    assert new.named["elbow_joint"].limits == arm().named[
        "elbow_joint"
    ].limits._replace(upper=1.5, velocity=0.5)


def test_endless_joints_get_ends():
    file = "kinova_description/robots/kinova.urdf"
    name = "j2s6s200_joint_1"
    assert arm(file).named[name].kind == "continuous"
    joint = arm(file, limits={name: {"lower": -3.0, "upper": 3.0}}).named[name]
    assert (joint.kind, joint.range) == ("revolute", (-3.0, 3.0))


def test_shapes_are_replaced(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    disc = {"radius": 0.03, "length": 0.02, "z": 0.1}
    mesh = "ur_description/meshes/ur5/collision/base.stl"
    links = arm(
        collisions={"base_link": mesh, "wrist_3_link": disc}, undrawn=["base.dae"]
    ).links
    (hull,) = links["base_link"].collisions
    assert hull.shape.is_relative_to(tmp_path)
    assert hull.shape.suffix == ".stl"
    assert links["wrist_3_link"].collisions == (
        RobotShape(Cylinder(0.03, 0.02), Origin((0.0, 0.0, 0.1))),
    )
    assert (len(links["base_link"].visuals), len(links["wrist_3_link"].visuals)) == (
        0,
        1,
    )

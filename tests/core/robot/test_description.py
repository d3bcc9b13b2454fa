from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool
from core.geometry import Box, Capsule, Cylinder, Pose, Sphere
from core.imports.documents import read_xml
from core.imports.urdf import read_tree
from core.robot.description import assemble, assembled
from core.robot.writing import write
from tests.support.panda import ARM_JOINTS, FINGER_JOINTS, HOME_JOINTS, PANDA
from tests.support.shapes import bowl, prism

LEFT, RIGHT = GRIPPER_MOUNTS


def box(name, parent, at, size, rpy=(0, 0, 0), mass=0.05):
    return Component(
        name, parent, Pose.xyz_rpy(at, rpy), Box(size), mass, (0.1, 0.2, 0.3, 0.4)
    )


RIGID = Tool(
    (
        box(
            "shaft",
            RIGID_MOUNT,
            (0.1, 0, -0.01),
            (0.3, 0.03, 0.02),
            (0, 0.3, 0.2),
            0.08,
        ),
        box(
            "blade",
            "shaft",
            (0.16, 0.02, -0.05),
            (0.02, 0.12, 0.1),
            (0.4, 0, 0.7),
            0.03,
        ),
    )
)
GRIPPER = Tool(
    (
        box(
            "left_pad",
            LEFT,
            (0.01, 0.0075, 0.07),
            (0.05, 0.015, 0.04),
            (0.1, 0.2, 0.3),
            0.02,
        ),
        box(
            "right_pad",
            RIGHT,
            (0.01, -0.0075, 0.07),
            (0.05, 0.015, 0.04),
            (0, 0, 0.5),
            0.03,
        ),
        box(
            "right_tip", "right_pad", (0, 0, 0.03), (0.02, 0.02, 0.02), (0, 1, 0), 0.01
        ),
    ),
    gripper=True,
)
SHAPES = (
    Box((0.1, 0.2, 0.3)),
    Sphere(0.1),
    Cylinder(0.05, 0.3),
    Capsule(0.05, 0.3),
    prism(5, 0.1, 0.2),
    bowl(0.1, 0.01),
)
ROUND = Tool(
    tuple(
        Component(
            f"c{i}",
            RIGID_MOUNT,
            Pose.xyz_rpy((0.1 * i, 0.0, -0.2), (0.3 * i, 0.2, 0.1)),
            shape,
            0.1 + i / 10,
        )
        for i, shape in enumerate(SHAPES)
    )
)
TOOLS = {
    "rigid": RIGID,
    "gripper": GRIPPER,
    "round": ROUND,
    "bare arm": Tool(),
    "bare hand": Tool(gripper=True),
    "none": None,
}
every_tool = pytest.mark.parametrize("tool", TOOLS.values(), ids=TOOLS)


def model_of(tool, **how):
    return pin.buildModelFromXML(assemble(PANDA, tool, visuals=False, **how))


def home(model):
    q = pin.neutral(model)
    for name, angle in zip(ARM_JOINTS, HOME_JOINTS, strict=True):
        q[model.joints[model.getJointId(name)].idx_q] = angle
    for name in FINGER_JOINTS:
        if model.existJointName(name):
            q[model.joints[model.getJointId(name)].idx_q] = 0.03
    return q


def frame_pose(model, name):
    data = model.createData()
    pin.framesForwardKinematics(model, data, home(model))
    return Pose.from_matrix(data.oMf[model.getFrameId(name)].homogeneous)


def links(tool, **how):
    return assembled(PANDA, tool, **how).links


# --- the mounts -------------------------------------------------------------------------------------------------


def test_the_rigid_mount_takes_the_hands_place():
    assert not {"panda_hand", *GRIPPER_MOUNTS} & set(links(RIGID))
    rigid, hand = model_of(Tool()), model_of(None)
    for name in (RIGID_MOUNT, "panda_link7"):
        np.testing.assert_allclose(
            frame_pose(rigid, name).matrix, frame_pose(hand, name).matrix, atol=1e-6
        )
    link7, virtual = frame_pose(rigid, "panda_link7"), frame_pose(rigid, RIGID_MOUNT)
    np.testing.assert_allclose(
        (link7.inverse() @ virtual).position, [0, 0, 0.107], atol=1e-9
    )
    np.testing.assert_allclose(
        virtual.position, frame_pose(hand, "panda_hand").position, atol=1e-9
    )


# --- inertia ----------------------------------------------------------------------------------------------------


def test_the_inertia_of_every_shape_is_that_of_its_triangles():
    mass, middle, moments = links(ROUND, fused=True)[RIGID_MOUNT].inertial.placed()
    meshes = []
    for component in ROUND.components:
        mesh = component.shape.to_trimesh().apply_transform(
            ROUND.placed()[component.name][1].matrix
        )
        mesh.density = component.mass / mesh.volume
        meshes.append(mesh)
    center = sum(mesh.mass * mesh.center_mass for mesh in meshes) / ROUND.mass
    tensor = np.zeros((3, 3))
    for mesh in meshes:
        arm = mesh.center_mass - center
        tensor += mesh.moment_inertia + mesh.mass * (
            arm @ arm * np.eye(3) - np.outer(arm, arm)
        )
    assert mass == pytest.approx(ROUND.mass)
    np.testing.assert_allclose(middle, center, atol=1e-6)
    np.testing.assert_allclose(moments, tensor, rtol=0.01, atol=2e-5)


def test_convex_parts_collide_and_the_surface_is_drawn():
    link = links(ROUND, fused=True)[RIGID_MOUNT]
    drawn, solid = (
        [type(part.shape) for part in shapes]
        for shapes in (link.visuals, link.collisions)
    )
    primitives, mesh = (
        [Box, Sphere, Cylinder, Cylinder, Sphere, Sphere],
        type(link.visuals[-1].shape),
    )
    assert drawn == [*primitives, mesh, mesh]
    assert solid == [*primitives, mesh, *[mesh] * 48]
    volume = trimesh.load_mesh(link.visuals[-1].shape).volume
    assert volume == pytest.approx(ROUND.components[-1].shape.volume)


def whole_inertia(model):
    """Mass, centre of mass and inertia of the robot at home as one rigid body."""
    data = model.createData()
    pin.ccrba(model, data, home(model), np.zeros(model.nv))
    pin.centerOfMass(model, data, home(model))
    # The data's own arrays die with it.
    return (data.mass[0], data.com[0].copy(), data.Ig.inertia.copy())


@every_tool
def test_fused_or_not_the_robot_weighs_the_same(tool):
    apart, fused = model_of(tool), model_of(tool, fused=True)
    for one, other in zip(whole_inertia(apart), whole_inertia(fused), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-7)
    # Of what moves with each joint.
    for one, other in zip(apart.inertias, fused.inertias, strict=True):
        np.testing.assert_allclose(one.matrix(), other.matrix(), rtol=1e-6, atol=1e-8)
    bare = whole_inertia(model_of(Tool(gripper=tool is None or tool.gripper)))[0]
    assert whole_inertia(apart)[0] - bare == pytest.approx(
        0 if tool is None else tool.mass, abs=1e-9
    )


def test_a_finger_with_any_inertia_keeps_it_when_fused():
    """One from somebody's own URDF may be turned, and have products of inertia."""
    arm, name = PANDA.description, PANDA.gripper.links[0]
    own = replace(
        arm.links[name].inertial,
        moments=(3e-6, 4e-7, -5e-7, 4e-6, 6e-7, 5e-6),
        rpy=(0.3, -0.2, 0.5),
    )
    finger = replace(arm.links[name], inertial=own)
    skewed = replace(PANDA, description=replace(arm, links=arm.links | {name: finger}))
    apart, fused = (
        pin.buildModelFromXML(assemble(skewed, GRIPPER, visuals=False, fused=fused))
        for fused in (False, True)
    )
    for one, other in zip(apart.inertias, fused.inertias, strict=True):
        np.testing.assert_allclose(one.matrix(), other.matrix(), rtol=1e-6, atol=1e-9)


def test_fused_shapes_stand_where_the_components_do():
    placed = GRIPPER.placed()
    for mount in GRIPPER_MOUNTS:
        boxes = links(GRIPPER, fused=True)[mount].collisions[
            -2 if mount == RIGHT else -1 :
        ]
        own = [c for c in GRIPPER.components if placed[c.name][0] == mount]
        for part, component in zip(boxes, own, strict=True):
            np.testing.assert_allclose(
                part.origin.pose.matrix, placed[component.name][1].matrix, atol=1e-7
            )
            assert part.shape == component.shape


# --- the text ---------------------------------------------------------------------------------------------------


@every_tool
@pytest.mark.parametrize("fused", [False, True])
def test_every_urdf_is_one_tree(tool, fused):
    arm = assembled(PANDA, tool, fused=fused)
    assert (set(arm.joints), arm.root) == (
        set(arm.links) - {"panda_link0"},
        "panda_link0",
    )
    again = read_tree(read_xml(write(arm).encode(), Path("again.urdf")))
    assert (set(again.links), again.joints) == (set(arm.links), arm.joints)
    for name, link in arm.links.items():
        assert (again.links[name].inertial, again.links[name].visuals) == (
            link.inertial,
            link.visuals,
        )
    movable = 9 if tool is None or tool.gripper else 7
    assert pin.buildModelFromXML(assemble(PANDA, tool, fused=fused)).nq == movable

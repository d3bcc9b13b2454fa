"""Mount a tool on an arm's description."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import chain

import numpy as np

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool, ToolJoint
from core.geometry import Array, Pose, Shape
from core.robot.shape_files import urdf_shapes
from core.robot.writing import MeshPath, write, write_part
from core.values.descriptions import (
    PICOMETRES,
    Description,
    Inertial,
    Limits,
    RobotJoint,
    RobotLink,
    RobotShape,
    Weight,
    rounded,
    rounded_all,
)
from core.values.robots import Robot

BASE = "world_base"  # the root link of an arm that does not stand at the world's origin


def joint_name(link: str) -> str:
    """Name the joint that bears a component, or another link that is ours."""
    return f"{link}_joint"


@lru_cache(maxsize=8)  # an engine asks for it several times
def assembled(
    robot: Robot, tool: Tool | None = None, *, fused: bool = False
) -> Description:
    """Mount a tool on the arm.

    A rigid tool replaces the gripper; with a gripper tool the gripper stays. The mount is `core.design.RIGID_MOUNT`, a
    link without mass; the fingers are named as the mounts of a gripper tool. The root is the base, or, if that does not
    stand at the world's origin, `BASE`.

    Args:
        robot: the arm.
        tool: the mounted tool; without components the bare flange, or with ``gripper`` the bare gripper. None: the bare
            gripper, or the bare flange of an arm without one.
        fused: merge the tool's components into the link that bears them (for engines: fewer links, the same physics)
            instead of giving each a link of its own (for people).
    """
    gripper = robot.gripper
    if tool is None:
        tool = Tool(gripper=gripper is not None)

    arm = robot.description
    mount = _joint(RIGID_MOUNT, robot.mount_link, robot.mount)

    if gripper is not None and tool.gripper:
        arm = arm.renamed(dict(zip(gripper.links, GRIPPER_MOUNTS, strict=True)))
        mount = _joint(RIGID_MOUNT, gripper.link, gripper.mount)
    elif gripper is not None:
        arm = arm.without(gripper.link)

    links = {**arm.links, RIGID_MOUNT: RobotLink(RIGID_MOUNT)}
    joints = {**arm.joints, RIGID_MOUNT: mount}
    parts = tool_parts(tool)

    if fused:
        parts = ((RobotLink(bearer.name), _joint(*bearer)) for bearer in tool.bearers)

    for link, bearing in parts:
        links[link.name] = link
        joints[link.name] = bearing

    if robot.base != Pose():
        links[BASE] = RobotLink(BASE)
        base = _joint(arm.root, BASE, robot.base)
        joints[arm.root] = replace(base, name=joint_name(BASE))

    if fused:
        links = {name: _fuse(link, tool) for name, link in links.items()}

    return Description(arm.name, links, joints)


@lru_cache(maxsize=16)
def beyond(robot: Robot, tool: Tool) -> frozenset[str]:
    """Name the links that the arm's last joint moves, with those of the tool, as `assembled` for engines."""
    arm = assembled(robot, tool, fused=True)
    last = arm.named[robot.arm_joints[-1]].child
    return frozenset(name for name in arm.links if last in arm.above(name))


def tool_parts(tool: Tool) -> Iterator[tuple[RobotLink, RobotJoint]]:
    """Yield the links of a tool's components, and the joints that bear them."""
    frames = {component.name: component.link for component in tool.components}

    for component in tool.components:
        in_link = component.link.inverse()
        weight = weigh(component.shape, component.mass, in_link)
        inertial = Inertial.from_tensor(*weight)
        link = RobotLink(component.name, inertial, *_place_shapes(component, in_link))

        pose = component.pose

        if component.joint is not None:
            pose = pose @ component.link

        if component.parent in frames:
            pose = frames[component.parent].inverse() @ pose

        yield link, _joint(component.name, component.parent, pose, component.joint)


def weigh(shape: Shape, mass: float, pose: Pose) -> Weight:
    """Compute the inertia of a solid at a pose, in the axes of the frame that the pose is given in."""
    center, tensor = shape.inertia(mass)
    turn = pose.rotation_matrix

    return mass, pose.apply(center), turn @ tensor @ turn.T


def _joint(
    name: str,
    parent: str,
    pose: Pose,
    moving: ToolJoint | None = None,
) -> RobotJoint:
    """Make the joint that bears a link of a tool, or a frame.

    Args:
        name: of the link.
        parent: the link that it hangs from.
        pose: where it hangs there.
        moving: how it moves; None: it does not.
    """
    fixed = RobotJoint.fixed(joint_name(name), parent, name, pose)

    if moving is None:
        return fixed

    def exact(value: float) -> float:
        return rounded(value, PICOMETRES)

    spring = (exact(moving.stiffness), exact(moving.rest))
    return replace(
        fixed,
        kind="revolute" if moving.kind == "hinge" else "prismatic",
        axis=rounded_all(moving.axis, PICOMETRES),
        limits=Limits(exact(moving.lower), exact(moving.upper), 0.0, 1000.0),
        damping=exact(moving.damping),
        friction=exact(moving.friction),
        spring=spring if moving.stiffness else None,
    )


def _place_shapes(
    component: Component, pose: Pose
) -> tuple[tuple[RobotShape, ...], tuple[RobotShape, ...]]:
    """Make the collision and the visual shapes of a component at a pose in its link."""
    parts = component.shape.convex_parts()
    collisions = chain.from_iterable(urdf_shapes(part, pose) for part in parts)
    drawn = urdf_shapes(component.shape, pose)
    visuals = [replace(shape, color=component.color) for shape in drawn]

    return tuple(collisions), tuple(visuals)


def merge_inertias(parts: Sequence[Weight]) -> Weight:
    """Merge the inertias of rigidly joined parts, all in one frame."""
    masses, centers, _ = zip(*parts, strict=True)
    center: Array = np.average(centers, axis=0, weights=masses)
    whole = np.zeros((3, 3))

    for mass, place, tensor in parts:
        arm = place - center
        whole += tensor + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))

    return sum(masses), center, whole


def _fuse(link: RobotLink, tool: Tool) -> RobotLink:
    """Merge the components that a link bears into it: many shapes, one inertia."""
    borne = [c for c in tool.components if tool.borne[c.name][0] == link.name]

    if not borne:
        return link

    weights = [link.inertial.placed()] if link.inertial.mass > 0 else []
    collisions = link.collisions
    visuals = link.visuals

    for component in borne:
        _, pose = tool.borne[component.name]
        weights.append(weigh(component.shape, component.mass, pose))
        solid, drawn = _place_shapes(component, pose)
        collisions += solid
        visuals += drawn

    inertial = Inertial.from_tensor(*merge_inertias(weights))
    return RobotLink(link.name, inertial, collisions, visuals)


def assemble(
    robot: Robot,
    tool: Tool,
    *,
    fused: bool = False,
    visuals: bool = True,
    mesh_path: MeshPath = str,
) -> str:
    """Write the arm with a tool mounted as URDF text; see `assembled` and `core.robot.writing.write`."""
    arm = assembled(robot, tool, fused=fused)
    return write(arm, visuals=visuals, mesh_path=mesh_path)


def tool_urdf(tool: Tool, *, mesh_path: MeshPath = str) -> str:
    """Write the tool's links and joints as text, without a root element.

    A capsule, which URDF lacks, is a cylinder and two spheres. ``mesh_path`` maps a mesh's absolute path to the text
    that is written.
    """
    return "".join(write_part(*part, mesh_path) for part in tool_parts(tool))

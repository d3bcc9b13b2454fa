"""Write the arm with a tool mounted as one URDF, from the description that a robot carries."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool, ToolJoint
from core.geometry import Array, Box, Capsule, Cylinder, Mesh, Pose, Shape, Sphere, mass_properties
from core.support.scratch import scratch, write_once
from core.values.robots import Robot

MeshPath = Callable[[Path], str]
BASE = "world_base"  # the root link of an arm that does not stand at the world's origin


def _numbers(values: Iterable[float]) -> str:
    return " ".join(map(_number, values))


def _number(value: float) -> str:
    return f"{round(float(value), 12) + 0.0:.15g}"


def _origin(parent: Any, pose: Pose) -> None:
    etree.SubElement(parent, "origin", xyz=_numbers(pose.position), rpy=_numbers(pose.rpy))


def _inertial(link: Any, mass: float, center: Array, tensor: Array) -> None:
    element = etree.SubElement(link, "inertial")
    etree.SubElement(element, "origin", xyz=_numbers(center), rpy="0 0 0")
    etree.SubElement(element, "mass", value=f"{mass:.15g}")
    names = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    etree.SubElement(element, "inertia", {name: f"{tensor[at]:.15g}" for name, at in names.items()})


def _shapes(link: Any, component: Component, pose: Pose, capsules: bool = False) -> None:
    for tag, shapes in (("visual", (component.shape.drawn,)), ("collision", component.shape.convex_parts())):
        for at, geometry in (written for shape in shapes for written in _geometry(shape, capsules)):
            element = etree.SubElement(link, tag)
            _origin(element, pose @ at if at else pose)
            etree.SubElement(element, "geometry").append(geometry)
            if tag == "visual":
                material = etree.SubElement(element, "material", name=f"{component.name}_color")
                etree.SubElement(material, "color", rgba=_numbers(component.color))


def _geometry(shape: Shape, capsules: bool = False) -> Iterator[tuple[Pose | None, Any]]:
    """Yield URDF's shapes that make up one of ours, with their poses; a mesh is a file of `scratch`."""
    match shape:
        case Box(size):
            yield None, etree.Element("box", size=_numbers(size))
        case Sphere(radius):
            yield None, etree.Element("sphere", radius=_numbers([radius]))
        case Cylinder(radius, length):
            yield None, etree.Element("cylinder", radius=_numbers([radius]), length=_numbers([length]))
        case Capsule(radius, length) if capsules:
            yield None, etree.Element("capsule", radius=_numbers([radius]), length=_numbers([length]))
        case Capsule(radius, length):  # URDF has none
            yield from _geometry(Cylinder(radius, length))
            for end in (-length / 2, length / 2):
                ((_, ball),) = _geometry(Sphere(radius))
                yield Pose(np.array([0.0, 0.0, end])), ball
        case Mesh():
            file = scratch() / f"{shape.content}.obj"
            write_once(file, lambda: str(shape.to_trimesh().export(file_type="obj", digits=12)))
            yield None, etree.Element("mesh", filename=str(file))


def read_numbers(element: Any, name: str) -> Array:
    """Read the numbers of an element's attribute; three zeros without one."""
    return np.array([float(number) for number in element.get(name, "0 0 0").split()])


def read_origin(element: Any) -> Pose:
    """Read the pose of a link's shape or inertia, or of a joint."""
    origin = element.find("origin")
    return Pose() if origin is None else Pose.xyz_rpy(read_numbers(origin, "xyz"), read_numbers(origin, "rpy"))


def read_shape(element: Any) -> Box | Sphere | Cylinder | Path:
    """Read a shape; a mesh is its file, whose scale is not read."""
    match element.tag:
        case "box":
            x, y, z = read_numbers(element, "size").tolist()
            return Box((x, y, z))
        case "sphere":
            return Sphere(float(element.get("radius")))
        case "cylinder":
            return Cylinder(float(element.get("radius")), float(element.get("length")))
        case _:
            return Path(element.get("filename"))


def read_inertia(inertial: Any) -> tuple[float, Array]:
    """Read a mass, kg, and the tensor (3, 3) about its centre, in the axes of its origin."""
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    xx, xy, xz, yy, yz, zz = (float(inertial.find("inertia").get(name)) for name in names)
    return float(inertial.find("mass").get("value")), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def merged(parts: Sequence[tuple[float, Array, Array]]) -> tuple[float, Array, Array]:
    """Merge rigidly joined parts: their mass, centre (3,), and inertia tensor (3, 3) about it; one frame for all."""
    masses, centers, _ = zip(*parts, strict=True)
    center: Array = np.average(centers, axis=0, weights=masses)
    tensor = np.zeros((3, 3))
    for mass, at, own in parts:
        arm = at - center
        tensor += own + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return sum(masses), center, tensor


def tool_elements(tool: Tool, *, capsules: bool = False) -> list[Any]:
    """Make the tool's links and joints as URDF elements, children of the robot element."""
    elements, links = [], {component.name: component.link for component in tool.components}
    for component in tool.components:
        link, own = etree.Element("link", name=component.name), component.link.inverse()
        center, tensor = mass_properties(component.shape, component.mass)
        _inertial(link, component.mass, own.apply(center), tensor)
        _shapes(link, component, own, capsules)
        pose = component.pose @ component.link if component.joint else component.pose
        pose = links[component.parent].inverse() @ pose if component.parent in links else pose
        elements += [link, _joint(component.name, component.parent, pose, component.joint)]
    return elements


def _joint(name: str, parent: str, pose: Pose, moving: ToolJoint | None) -> Any:
    """Make the joint that bears a link of a tool. URDF has no springs; other readers skip our ``<spring>``."""
    kind = {"hinge": "revolute", "slider": "prismatic"}[moving.kind] if moving else "fixed"
    joint = etree.Element("joint", name=joint_name(name), type=kind)
    etree.SubElement(joint, "parent", link=parent)
    etree.SubElement(joint, "child", link=name)
    _origin(joint, pose)
    if moving:
        etree.SubElement(joint, "axis", xyz=_numbers(moving.axis))
        lower, upper, damping, friction = map(_number, (moving.lower, moving.upper, moving.damping, moving.friction))
        etree.SubElement(joint, "limit", lower=lower, upper=upper, effort="0", velocity="1000")
        etree.SubElement(joint, "dynamics", damping=damping, friction=friction)
        if moving.stiffness:
            etree.SubElement(joint, "spring", stiffness=_number(moving.stiffness), rest=_number(moving.rest))
    return joint


def joint_name(component: str) -> str:
    """Name the joint that bears a component."""
    return f"{component}_joint"


def to_text(element: Any) -> str:
    etree.indent(element, "  ")
    return str(etree.tostring(element, encoding="unicode")) + "\n"


def tool_urdf(tool: Tool, *, capsules: bool = False, mesh_path: MeshPath = str) -> str:
    """Write the tool's links and joints as text, without a root element.

    With ``capsules`` a capsule is an element of that name, which URDF lacks; else a cylinder and two spheres.
    ``mesh_path`` maps a mesh's absolute path to the text that is written.
    """
    elements = tool_elements(tool, capsules=capsules)
    for mesh in (mesh for element in elements for mesh in element.iter("mesh")):
        mesh.set("filename", mesh_path(Path(str(mesh.get("filename")))))
    return "".join(map(to_text, elements))


def _fuse(link: Any, tool: Tool, bearer: str) -> None:
    """Merge the components on ``bearer`` into its link: many shapes, one inertia."""
    parts = [(c, tool.borne[c.name][1]) for c in tool.components if tool.borne[c.name][0] == bearer]
    if not parts:
        return
    own, inertias = link.find("inertial"), []
    if own is None:
        own = etree.SubElement(link, "inertial")
    elif (own_mass := float(own.find("mass").get("value"))) > 0:
        origin, (_, tensor) = read_origin(own), read_inertia(own)
        turn = origin.rotation.as_matrix()
        inertias.append((own_mass, origin.position, turn @ tensor @ turn.T))
    link.remove(own)
    for component, pose in parts:
        turn, (center, tensor) = pose.rotation.as_matrix(), mass_properties(component.shape, component.mass)
        inertias.append((component.mass, pose.apply(center), turn @ tensor @ turn.T))
    _inertial(link, *merged(inertias))
    for component, pose in parts:
        _shapes(link, component, pose)


def assemble(
    robot: Robot, tool: Tool | None = None, *, fused: bool = False, visuals: bool = True, mesh_path: MeshPath = str
) -> str:
    """Write the arm with a tool mounted as URDF text.

    A rigid tool replaces the gripper; with a gripper tool the gripper stays. The mount is `core.design.RIGID_MOUNT`, a
    link without mass; the fingers are named as the mounts of a gripper tool. The root is the base, or, if that does not
    stand at the world's origin, `BASE`.

    Args:
        robot: the arm.
        tool: the mounted tool; without components the bare flange, or with ``gripper`` the bare gripper. None: the bare
            gripper, or the bare flange of an arm without one.
        fused: merge the tool's components into the link that bears them (for engines: fewer links, the same physics)
            instead of giving each a link of its own (for people).
        visuals: include the visual shapes of the arm and of the tool.
        mesh_path: maps a mesh's absolute path to the text that is written.
    """
    tool = tool if tool is not None else Tool(gripper=robot.gripper is not None)
    parser = etree.XMLParser(remove_comments=True, remove_blank_text=True)
    root = etree.fromstring(robot.urdf.encode(), parser)
    if robot.gripper is not None:
        if tool.gripper:
            _rename_links(root, dict(zip(robot.gripper.links, GRIPPER_MOUNTS, strict=True)))
        else:
            _remove_branch(root, robot.gripper.link)
    bearer, mount = robot.mount_link, robot.mount
    if tool.gripper and robot.gripper is not None:
        bearer, mount = robot.gripper.link, robot.gripper.mount
    _add_frame(root, RIGID_MOUNT, bearer, mount)
    if fused:
        for name, parent, pose, joint in tool.bearers:
            etree.SubElement(root, "link", name=name)
            root.append(_joint(name, parent, pose, joint))
        for name in tool.borne_on:
            _fuse(root.find(f"link[@name='{name}']"), tool, name)
    else:
        root.extend(tool_elements(tool))
    for link in root.findall("link"):
        for visual in link.findall("visual") if not visuals else ():
            link.remove(visual)
        for mesh in link.iter("mesh"):
            mesh.set("filename", mesh_path(Path(str(mesh.get("filename")))))
    if robot.base != Pose():
        _place_base(root, robot.base)
    for link in root.findall("link"):
        if link.find("inertial") is None:  # in URDF none; engines would guess one
            _inertial(link, 0.0, np.zeros(3), np.zeros((3, 3)))
    return to_text(root)


def root_link(root: Any) -> str:
    """Name the link of a URDF's root element that no joint bears."""
    borne = {joint.find("child").get("link") for joint in root.findall("joint")}
    return next(str(link.get("name")) for link in root.findall("link") if link.get("name") not in borne)


def _add_frame(root: Any, name: str, parent: str, pose: Pose) -> None:
    """Add a link without mass."""
    _inertial(etree.SubElement(root, "link", name=name), 0.0, np.zeros(3), np.zeros((3, 3)))
    joint = etree.SubElement(root, "joint", name=f"{name}_joint", type="fixed")
    etree.SubElement(joint, "parent", link=parent)
    etree.SubElement(joint, "child", link=name)
    _origin(joint, pose)


def _place_base(root: Any, base: Pose) -> None:
    child = root_link(root)
    etree.SubElement(root, "link", name=BASE)
    joint = etree.SubElement(root, "joint", name=f"{BASE}_joint", type="fixed")
    etree.SubElement(joint, "parent", link=BASE)
    etree.SubElement(joint, "child", link=child)
    _origin(joint, base)


def _remove_branch(root: Any, link: str) -> None:
    """Remove a link and all that it bears."""
    children: dict[str, list[Any]] = {}
    for joint in root.findall("joint"):
        children.setdefault(joint.find("parent").get("link"), []).append(joint)
    borne = [link]
    for name in borne:
        borne += [joint.find("child").get("link") for joint in children.get(name, ())]
    for element in list(root):
        child = element.find("child")
        if element.get("name") in borne or (child is not None and child.get("link") in borne):
            root.remove(element)


def _rename_links(root: Any, names: dict[str, str]) -> None:
    for link in root.findall("link"):
        link.set("name", names.get(link.get("name"), link.get("name")))
    for end in root.iter("parent", "child"):
        end.set("link", names.get(end.get("link"), end.get("link")))

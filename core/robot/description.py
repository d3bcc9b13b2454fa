"""Describe the Franka Panda: links, mounts, and the arm with a tool as one URDF.

The description is franka_ros's, from the package example-robot-data. Any engine can read it without PyBullet, and its
masses and inertias are the identified ones (C. Gaz et al., "Dynamic identification of the
Franka Emika Panda robot with retrieval of feasible parameters using penalty-based optimization", IEEE RA-L 2019),
where pybullet_data's copy has placeholders. `tests/core/robot/test_description.py` checks that they are physical.
"""

from __future__ import annotations

import importlib.metadata
import json
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool
from core.errors import UserError
from core.geometry import Array, Cylinder, Pose

ARM_JOINTS = tuple(f"panda_joint{i}" for i in range(1, 8))
FINGER_JOINTS = ("panda_finger_joint1", "panda_finger_joint2")
FINGER_OPEN = 0.04  # metres from the middle, each finger
GRIP_FORCE = 70.0  # newtons, each finger: the hand's continuous force, Franka hand's data sheet
FINGER_FRICTION = 1.0  # rubber tips
TOOL_FRICTION = 0.5  # printed plastic; the arm's links too
HOME_JOINTS = (-0.0018, -0.1860, 0.0017, -2.1008, 0.0003, 1.9147, 0.7847)

# Joint accelerations that the arm allows, rad/s^2: Franka Control Interface documentation, "Robot and interface
# specifications".
ACCELERATION_LIMITS = np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0])

# Inertia of each joint's motor, reflected through its gear, kg m^2: Franka's figures for the FR3, in the README of
# Drake's franka_description. A URDF has none of it, and without it a light tool's blow has hardly anything behind it.
MOTOR_INERTIA = (0.605721456, 0.605721456, 0.462474144, 0.462474144, 0.205544064, 0.205544064, 0.205544064)

# The flange that bears a rigid tool: outer diameter of ISO 9409-1-50, centred at the mount's origin.
FLANGE = Cylinder(radius=0.0315, length=0.01)

# How exact the arm is in each engine: `core.facts` measures and writes it.
MEASURED = Path(__file__).with_name("measured.json")

_HAND_LINKS = ("panda_hand", "panda_hand_tcp", *GRIPPER_MOUNTS)
_MESH_PREFIX = "package://example-robot-data/robots/panda_description/"

MeshPath = Callable[[Path], str]


@lru_cache(maxsize=1)
def description_folder() -> Path:
    """Find the folder of the Panda's description.

    Raises:
        UserError: the package example-robot-data is not installed, or has no Panda.
    """
    try:
        files = importlib.metadata.files("example-robot-data") or []
    except importlib.metadata.PackageNotFoundError:
        files = []
    for file in files:
        if file.match("panda_description/urdf/panda.urdf"):
            return Path(str(file.locate())).resolve().parents[1]
    raise UserError("the Panda's description is missing: pip install example-robot-data")


@lru_cache(maxsize=1)
def measured_figures() -> dict[str, dict[str, float | None]]:
    """Read what was measured, by engine and figure (`core.conformance.exactness`)."""
    figures: dict[str, dict[str, float | None]] = json.loads(MEASURED.read_text(encoding="utf-8"))
    return figures


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{round(float(value), 12) + 0.0:.15g}" for value in values)


def _origin(parent: Any, pose: Pose) -> None:
    etree.SubElement(parent, "origin", xyz=_numbers(pose.position), rpy=_numbers(pose.rpy))


def _inertial(link: Any, mass: float, center: Array, tensor: Array) -> None:
    element = etree.SubElement(link, "inertial")
    etree.SubElement(element, "origin", xyz=_numbers(center), rpy="0 0 0")
    etree.SubElement(element, "mass", value=f"{mass:.15g}")
    names = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    etree.SubElement(element, "inertia", {name: f"{tensor[at]:.15g}" for name, at in names.items()})


def _shapes(link: Any, component: Component, pose: Pose) -> None:
    for tag in ("visual", "collision"):
        element = etree.SubElement(link, tag)
        _origin(element, pose)
        geometry = etree.SubElement(element, "geometry")
        etree.SubElement(geometry, "box", size=_numbers(component.shape.size))
        if tag == "visual":
            material = etree.SubElement(element, "material", name=f"{component.name}_color")
            etree.SubElement(material, "color", rgba=_numbers(component.color))


def read_numbers(element: Any, name: str) -> Array:
    """Read the numbers of an element's attribute; three zeros without one."""
    return np.array([float(number) for number in element.get(name, "0 0 0").split()])


def read_origin(element: Any) -> Pose:
    """Read the pose of a link's shape or inertia, or of a joint."""
    origin = element.find("origin")
    return Pose() if origin is None else Pose.xyz_rpy(read_numbers(origin, "xyz"), read_numbers(origin, "rpy"))


def merged(parts: Sequence[tuple[float, Array, Array]]) -> tuple[float, Array, Array]:
    """Merge rigidly joined parts: their mass, centre (3,), and inertia tensor (3, 3) about it; one frame for all."""
    masses, centers, _ = zip(*parts, strict=True)
    center: Array = np.average(centers, axis=0, weights=masses)
    tensor = np.zeros((3, 3))
    for mass, at, own in parts:
        arm = at - center
        tensor += own + mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return sum(masses), center, tensor


def box_inertia(component: Component) -> Array:
    """Compute a component's inertia tensor (3, 3) about its centre, in its own axes."""
    x, y, z = np.square(component.shape.size)
    return component.mass / 12 * np.diag([y + z, x + z, x + y])


def tool_elements(tool: Tool) -> list[Any]:
    """Make the tool's links and joints as URDF elements, children of the robot element."""
    elements = []
    for component in tool.components:
        link = etree.Element("link", name=component.name)
        _inertial(link, component.mass, np.zeros(3), box_inertia(component))
        _shapes(link, component, Pose())
        joint = etree.Element("joint", name=f"{component.name}_joint", type="fixed")
        etree.SubElement(joint, "parent", link=component.parent)
        etree.SubElement(joint, "child", link=component.name)
        _origin(joint, component.pose)
        elements += [link, joint]
    return elements


def to_text(element: Any) -> str:
    etree.indent(element, "  ")
    return str(etree.tostring(element, encoding="unicode")) + "\n"


def tool_urdf(tool: Tool) -> str:
    """Write the tool's links and joints as text, without a root element."""
    return "".join(to_text(element) for element in tool_elements(tool))


def _fuse(link: Any, tool: Tool, mount: str) -> None:
    """Merge the components on ``mount`` into its link: many shapes, one inertia."""
    placed = tool.placed()
    parts = [(c, placed[c.name][1]) for c in tool.components if placed[c.name][0] == mount]
    if not parts:
        return
    own, inertias = link.find("inertial"), []
    if (own_mass := float(own.find("mass").get("value"))) > 0:
        diagonal = [float(own.find("inertia").get(name)) for name in ("ixx", "iyy", "izz")]  # no finger has products
        inertias.append((own_mass, read_numbers(own.find("origin"), "xyz"), np.diag(diagonal)))
    link.remove(own)
    turned = [pose.rotation.as_matrix() for _, pose in parts]
    inertias += [(c.mass, at.position, r @ box_inertia(c) @ r.T) for (c, at), r in zip(parts, turned, strict=True)]
    _inertial(link, *merged(inertias))
    for component, pose in parts:
        _shapes(link, component, pose)


def assemble(tool: Tool | None = None, *, fused: bool = False, visuals: bool = True, mesh_path: MeshPath = str) -> str:
    """Write the Panda with a tool mounted as URDF text.

    A rigid tool replaces the hand; with a gripper tool (or None, the bare hand) the hand stays. ``panda_virtual`` is
    at the hand's place, 0.107 m beyond ``panda_link7`` and rotated by -45 degrees, flipped so that at home its axes
    are the world's.

    Args:
        tool: the mounted tool; without components the bare flange, or with ``gripper`` the bare hand.
        fused: merge the tool's boxes into the link that bears them (for engines: fewer links, the same physics)
            instead of giving each a link of its own (for people).
        visuals: include the arm's visual meshes and the tool's visual boxes.
        mesh_path: maps a mesh's absolute path to the text that is written.
    """
    tool = tool if tool is not None else Tool(gripper=True)
    parser = etree.XMLParser(remove_comments=True, remove_blank_text=True)
    robot = etree.parse(description_folder() / "urdf" / "panda.urdf", parser).getroot()
    if not tool.gripper:
        for element in list(robot):
            child = element.find("child")
            if element.get("name") in _HAND_LINKS or (child is not None and child.get("link") in _HAND_LINKS):
                robot.remove(element)
    virtual = etree.SubElement(robot, "link", name=RIGID_MOUNT)
    _inertial(virtual, 0.0, np.zeros(3), np.zeros((3, 3)))
    joint = etree.SubElement(robot, "joint", name=f"{RIGID_MOUNT}_joint", type="fixed")
    etree.SubElement(joint, "parent", link="panda_hand" if tool.gripper else "panda_link8")
    etree.SubElement(joint, "child", link=RIGID_MOUNT)
    turn = (np.pi, 0.0, 0.0) if tool.gripper else (np.pi, 0.0, -np.pi / 4)
    _origin(joint, Pose.xyz_rpy((0.0, 0.0, 0.0), turn))
    if fused:
        for mount in tool.mounts:
            _fuse(robot.find(f"link[@name='{mount}']"), tool, mount)
    else:
        robot.extend(tool_elements(tool))
    for link in robot.findall("link"):
        for visual in link.findall("visual") if not visuals else ():
            link.remove(visual)
        for mesh in link.iter("mesh"):
            path = str(mesh.get("filename")).replace(_MESH_PREFIX, "")
            mesh.set("filename", mesh_path(description_folder() / path))
    return to_text(robot)

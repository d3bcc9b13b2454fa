"""Write the robot's URDF as a table that is read, not simulated: frames, joints, limits and boxes around its links."""

from __future__ import annotations

from typing import Any

import numpy as np
from lxml import etree

from core.design import RIGID_MOUNT, Tool
from core.geometry import Array
from core.robot.description import assemble, read_numbers
from core.robot.extents import link_extents
from core.support.text import short_numbers, table
from core.values.robots import Robot

HEAD = ("link on its parent", "joint", "xyz", "rpy", "range", "speed", "box around the link")
_MOTIONS = {"revolute": "turns about", "continuous": "turns about", "prismatic": "slides along"}


def outline(robot: Robot, tool: Tool) -> str:
    """Write a row for each link of the robot with ``tool`` that has a shape or bears another, and for the mount.

    It has the joint that bears the link, as in URDF: its motion, its origin in the parent's frame, its limits. The box
    is the smallest one along the link's axes around all of its collision shapes, from its lowest to its highest corner.
    """
    root: Any = etree.fromstring(assemble(robot, tool, visuals=False))
    joints = {joint.find("child").get("link"): joint for joint in root.findall("joint")}
    boxes = _boxes(robot, tool)
    bears = {RIGID_MOUNT, *boxes, *(joint.find("parent").get("link") for joint in joints.values())}
    names = [name for link in root.findall("link") if (name := str(link.get("name"))) in bears]
    return table(HEAD, [(*_joint(joints.get(name), name), boxes.get(name, "-")) for name in names])


def _joint(joint: Any, link: str) -> tuple[str, ...]:
    if joint is None:
        return link, "the base", "-", "-", "-", "-"
    origin, limit = joint.find("origin"), joint.find("limit")
    xyz, rpy = (np.zeros(3) if origin is None else read_numbers(origin, name) for name in ("xyz", "rpy"))
    way = _MOTIONS.get(joint.get("type"))
    axis = np.eye(3)[0] if joint.find("axis") is None else read_numbers(joint.find("axis"), "xyz")  # as URDF has it
    motion = joint.get("type") if way is None else f"{way} {_axis(axis)}"
    bounds = [float(limit.get(name, 0)) for name in ("lower", "upper", "velocity")] if limit is not None else []
    span = f"{bounds[0]:g} to {bounds[1]:g}" if bounds and joint.get("type") != "continuous" else "-"
    held = f"{link} on {joint.find('parent').get('link')}"
    return held, motion, short_numbers(xyz, 4), short_numbers(rpy, 4), span, f"{bounds[2]:g}" if bounds else "-"


def _axis(axis: Array) -> str:
    """The name of an axis, such as ``-y``; the numbers of one that is askew."""
    names = {tuple(sign * way): f"{'-' if sign < 0 else ''}{name}" for sign in (1, -1) for name, way in _AXES}
    return names.get(tuple(axis), short_numbers(axis, 4))


_AXES = tuple(zip("xyz", np.eye(3), strict=True))


def _boxes(robot: Robot, tool: Tool) -> dict[str, str]:
    """The box around each link of the robot, rounded to a millimetre, and each component's."""
    extents = {name: (low.round(3), high.round(3)) for name, (low, high) in link_extents(robot, tool.gripper).items()}
    for component in tool.components:
        middle, size = component.shape.bounds
        extents[component.name] = middle - size / 2, middle + size / 2
    return {name: f"{short_numbers(low, 4)} to {short_numbers(high, 4)}" for name, (low, high) in extents.items()}

"""Write the robot as a short URDF that is read, not simulated: frames, joints, limits and boxes around its links."""

from __future__ import annotations

from typing import Any

import numpy as np
from lxml import etree

from core.design import Tool
from core.geometry import Array
from core.robot.description import assemble, read_numbers
from core.robot.solids import robot_solids

_KEPT = ("parent", "child", "origin", "axis", "limit", "mimic")  # of a joint
_LIMITS = ("lower", "upper", "velocity")


def outline(tool: Tool) -> str:
    """Write the robot with ``tool`` as URDF, a line for each link and joint.

    Of a robot's link, the collision shape is the smallest box along its axes around all of its shapes. Components of
    the tool keep theirs. Visuals, inertias, efforts and dynamics are left out.
    """
    robot = etree.fromstring(assemble(tool, visuals=False))
    boxes = _boxes(tool.gripper)
    lines = []
    for element in robot:
        if element.tag == "link":
            collision = element.find("collision")
            element[:] = [] if collision is None else [collision]
            name = str(element.get("name"))
            if name in boxes:
                _replace(collision, *boxes[name])
        elif element.tag == "joint":
            element[:] = [child for child in element if child.tag in _KEPT]
            for limit in element.iter("limit"):
                for other in set(limit.attrib) - set(_LIMITS):
                    del limit.attrib[other]
        else:
            continue
        lines.append(_line(element))
    return "\n".join([f'<robot name="{robot.get("name")}">', *lines, "</robot>"])


def _boxes(gripper: bool) -> dict[str, tuple[Array, Array]]:
    """The lowest and highest corner of the box around each of the robot's links, in the link's frame."""
    boxes: dict[str, tuple[Array, Array]] = {}
    for solid in robot_solids(gripper):
        center, half = solid.bounds()
        low, high = boxes.get(solid.name, (center - half, center + half))
        boxes[solid.name] = np.minimum(low, center - half), np.maximum(high, center + half)
    return boxes


def _replace(collision: Any, low: Array, high: Array) -> None:
    collision[:] = []
    etree.SubElement(collision, "origin", xyz=_numbers(((low + high) / 2).round(3)))
    etree.SubElement(etree.SubElement(collision, "geometry"), "box", size=_numbers((high - low).round(3)))


def _line(element: Any) -> str:
    """Write an element on one line, numbers rounded, and zeros, which are the default, left out."""
    for box in element.iter("box"):
        box.set("size", _numbers(read_numbers(box, "size")))
    for origin in list(element.iter("origin")):
        for name in ("xyz", "rpy"):
            numbers = read_numbers(origin, name)
            origin.set(name, _numbers(numbers))
            if not numbers.round(4).any():
                del origin.attrib[name]
        if not origin.attrib:
            origin.getparent().remove(origin)
    plain = etree.Element(element.tag, element.attrib)
    plain[:] = element[:]
    for each in plain.iter():
        each.text = each.tail = None
    etree.cleanup_namespaces(plain)
    return str(etree.tostring(plain, encoding="unicode"))


def _numbers(values: Array) -> str:
    return " ".join(f"{round(float(value), 4) + 0.0:g}" for value in values)

"""Tools as URDF: the block of links and joints that is merged into the robot's own description."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from core.design import DesignError, Tool
from core.designs.elites import component_lines
from core.designs.rules import (
    MAX_BEND_M_N,
    MAX_COMPONENT_KG,
    MAX_COMPONENTS,
    MAX_DENSITY,
    MAX_EXTENT_M,
    MAX_GAP_M,
    MAX_LOAD_N,
    MAX_SIDE_M,
    MIN_COMPONENT_KG,
    MIN_DENSITY,
    MIN_SIDE_M,
    MIN_TOOL_KG,
)
from core.designs.weight import describe_weight
from core.geometry import Array
from core.interfaces import Brief, Robot, Task, ToolRepresentation
from core.robot.description import tool_urdf
from core.robot.extents import Finger, finger_gap, fingers_of
from core.text import kind, short_number, short_numbers
from plugins.tools.urdf.building import build_tool
from plugins.tools.urdf.parsing import parse_xml

_MEET_M = 0.0005  # fingers nearer than this meet


class UrdfTools(ToolRepresentation):
    """A tool is one field, ``tool_urdf``: URDF links and joints of boxes that hang from the mount."""

    def schema(self) -> dict[str, Any]:
        description = "URDF <link> and <joint> elements of the tool, without a root element"
        return {"tool_urdf": {"type": "string", "description": description}}

    def parse(self, data: Mapping[str, Any], *, gripper: bool) -> Tool:
        if "tool_urdf" not in data:
            raise DesignError("tool_urdf is missing; give the tool's <link> and <joint> elements")
        text = data["tool_urdf"]
        if not isinstance(text, str):
            raise DesignError(f"tool_urdf must be a text of <link> and <joint> elements, not {kind(text)}")
        return build_tool(parse_xml(text), gripper, self.robot, masses=self.material.density_kg_m3 is None)

    def dump(self, tool: Tool) -> dict[str, Any]:
        return {"tool_urdf": tool_urdf(tool)}

    def abridge(self, tool: Tool) -> dict[str, Any]:
        return {"components": component_lines(tool)}

    def instructions(self, brief: Brief) -> str:
        robot, elites = brief.task.robot, _ELITES if brief.elites else ""
        mount = _gripper_mount(robot) if brief.gripper else _rigid_mount(brief.task)
        example = _example(robot, brief.gripper)
        if self.material.density_kg_m3 is None:
            parts, weight = _INERTIAL, _MASSES.format(payload=f"{robot.payload_kg:g}")
            bend = "even if it were of steel, as it would a bar of 2 mm thickness and 0.25 m length"
        else:
            parts, weight = "a collision element", describe_weight(self.material, robot)
            example = _LIGHT.sub("", example)
            bend = f"or {MAX_LOAD_N:g} N would break it"
        return _RULES.format(mount=mount, elites=elites, parts=parts, weight=weight, bend=bend, example=example)


_RULES = f"""\
Write each tool as a block of URDF <link> and <joint> elements in `tool_urdf`. The block is merged into the robot's URDF
before its closing tag, so it has no root element and none of the robot's own links or joints.{{elites}}

{{mount}}

- Boxes only: <box size="x y z"/>, full side lengths in metres, each {MIN_SIDE_M:g} to {MAX_SIDE_M:g}. No meshes,
  cylinders or spheres.
- One link per box, with {{parts}}; the visual is made from the collision. At most
  {MAX_COMPONENTS} boxes.
{{weight}}
- The tool ends within {MAX_EXTENT_M:g} m of its mount. It is rigid: it is an error if 1 N at any end would bend it by
  more than {MAX_BEND_M_N * 1000:g} mm {{bend}}.
- Every link is the child of exactly one joint of type "fixed", and following parents leads to the mount. The joint's
  origin is the link's frame in its parent's frame; a box is centred on its own origin, so use half lengths to make
  parts meet.
- Every box touches or overlaps its parent; a gap of more than {MAX_GAP_M * 1000:g} mm is an error. Gaps are measured
  between the surfaces of the boxes as they are turned, not between boxes around them.
- Names: letters, digits, '_', '.', '-'; each link and each joint has its own.
- Colours are welcome: <material name="..."><color rgba="r g b a"/></material> in the collision, numbers from 0 to 1.
- Tools of several well-placed boxes (hooks, walls, scoops, bends) tend to do better than a plain bar.

Example of one link and its joint:
{{example}}"""

_INERTIAL = "a collision and an inertial element"
_MASSES = f"""\
- The inertial needs <mass value="..."/> in kilograms; moments of inertia are computed from the box. A few grams per
  box help the arm to move well; the limits are {MIN_COMPONENT_KG:g} to {MAX_COMPONENT_KG:g} kg for a box,
  {MIN_DENSITY:g} to {MAX_DENSITY:g} kg/m^3 for its density, and {MIN_TOOL_KG:g} to {{payload}} kg for the tool."""
_LIGHT = re.compile(r"  <inertial>.*</inertial>\n")  # of the example

_ELITES = """
The elites show `components` in its place, a line for each box: the name of its link, its parent link, its size, `at`
the xyz and rpy (none: 0 0 0) of its joint's origin, its mass. A box is centred on its link's frame. Yours are URDF."""

_RIGID_MOUNT = """\
The tool is rigid{place}. It hangs from the link `tool_mount` on the arm's flange, whose
axes are the world's when its roll, pitch and yaw are 0{home}: x forward, y left, z up. The arm is above
it, so the tool extends toward -z. What hangs from `tool_mount` must touch the flange, a disc of
{diameter:g} mm diameter and {thickness:g} mm thickness centred at its origin and square to z."""

_GRIPPER_MOUNT = """\
The tool is a pair of attachments to the gripper's fingers, which open and close them: the left part hangs from the link
`left_finger`, the right part from `right_finger`; each must touch its finger. The frames part says how their axes lie.
{fingers}
The inner faces are {gap} m apart when the gripper is open, and {closed}."""


def _rigid_mount(task: Task) -> str:
    robot, disc = task.robot, task.robot.flange.disc
    return _RIGID_MOUNT.format(
        place=" and takes the place of the gripper" if robot.gripper else "",
        home=", as they are at home" if np.allclose(task.home.rpy, 0.0, atol=1e-3) else "",
        diameter=2000 * disc.radius,
        thickness=1000 * disc.length,
    )


def _gripper_mount(robot: Robot) -> str:
    gap = finger_gap(robot)
    closed = max(0.0, gap - 2 * robot.opening_m)
    return _GRIPPER_MOUNT.format(
        fingers="\n".join(map(_finger, fingers_of(robot))),
        gap=short_number(gap, 3),
        closed="meet when it is closed" if closed < _MEET_M else f"{short_number(closed, 3)} m when it is closed",
    )


def _finger(finger: Finger) -> str:
    ends = zip("xyz", *finger.extent, strict=True)
    space = ", ".join(f"{axis} {short_number(low, 4)} to {short_number(high, 4)}" for axis, low, high in ends)
    tip, inner = (f"{_axis(way)[1]} = {short_number(finger.face(way), 4)}" for way in (finger.tip, -finger.opens))
    faces = f"tip at {tip}, inner face at {inner}"
    return f"- In its frame `{finger.name}` takes up {space}; {faces}, opens toward {_axis(finger.opens)}."


def _axis(way: Array) -> str:
    """Name an axis (3,), perhaps reversed, such as +y."""
    at = int(np.abs(way).argmax())
    return f"{'-' if way[at] < 0 else '+'}{'xyz'[at]}"


def _example(robot: Robot, gripper: bool) -> str:
    """Write a shaft that hangs from the flange, or a pad on the inside of the left finger's tip."""
    if gripper:
        finger = fingers_of(robot)[0]
        out, down = np.abs(finger.opens), np.abs(finger.tip)
        mount, name, size = finger.name, "left_pad", 0.02 * (1 - out - down) + 0.015 * out + 0.04 * down
        at = np.mean(finger.extent, axis=0) * (1 - out - down)
        at += out * finger.face(-finger.opens) + 0.0075 * finger.opens + down * finger.face(finger.tip)
        at += 0.0155 * finger.tip  # it overlaps the finger by 4.5 mm
    else:
        mount, name, size = "tool_mount", "shaft", np.array([0.02, 0.02, 0.1])
        at = np.array([0.0, 0.0, -(robot.flange.disc.length + size[2]) / 2])
    return _EXAMPLE.format(mount=mount, name=name, size=short_numbers(size, 4), at=short_numbers(at, 4))


_EXAMPLE = """\
<link name="{name}">
  <collision>
    <geometry><box size="{size}"/></geometry>
    <material name="blue"><color rgba="0.2 0.4 0.8 1"/></material>
  </collision>
  <inertial><mass value="0.005"/></inertial>
</link>
<joint name="{name}_joint" type="fixed">
  <parent link="{mount}"/>
  <child link="{name}"/>
  <origin xyz="{at}" rpy="0 0 0"/>
</joint>"""

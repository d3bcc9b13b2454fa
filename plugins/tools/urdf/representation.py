"""Tools as URDF: the block of links and joints that is merged into the robot's own description."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from core.design import DesignError, Tool
from core.designs.elites import component_lines
from core.designs.rules import (
    MAX_BEND_M_N,
    MAX_COMPONENT_KG,
    MAX_COMPONENTS,
    MAX_DENSITY,
    MAX_EXTENT_M,
    MAX_GAP_M,
    MAX_SIDE_M,
    MIN_COMPONENT_KG,
    MIN_DENSITY,
    MIN_SIDE_M,
    MIN_TOOL_KG,
)
from core.interfaces import Brief, ToolRepresentation
from core.robot.description import tool_urdf
from core.text import kind
from plugins.tools.urdf.building import build_tool
from plugins.tools.urdf.parsing import parse_xml


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
        return build_tool(parse_xml(text), gripper, self.robot)

    def dump(self, tool: Tool) -> dict[str, Any]:
        return {"tool_urdf": tool_urdf(tool)}

    def abridge(self, tool: Tool) -> dict[str, Any]:
        return {"components": component_lines(tool)}

    def instructions(self, brief: Brief) -> str:
        robot, elites = brief.task.robot, _ELITES if brief.elites else ""
        disc = robot.flange.disc
        mount = _RIGID_MOUNT.format(diameter=2000 * disc.radius, thickness=1000 * disc.length)
        mount = _GRIPPER_MOUNT if brief.gripper else mount
        payload = f"{robot.payload_kg:g}"
        return _RULES.format(mount=mount, elites=elites, payload=payload, example=_example(brief.gripper))


_RULES = f"""\
Write each tool as a block of URDF <link> and <joint> elements in `tool_urdf`. The block is merged into the robot's URDF
before its closing tag, so it has no root element and none of the robot's own links or joints.{{elites}}

{{mount}}

- Boxes only: <box size="x y z"/>, full side lengths in metres, each {MIN_SIDE_M:g} to {MAX_SIDE_M:g}. No meshes,
  cylinders or spheres.
- One link per box, with a collision and an inertial element; the visual is made from the collision. At most
  {MAX_COMPONENTS} boxes.
- The inertial needs <mass value="..."/> in kilograms; moments of inertia are computed from the box. A few grams per
  box help the arm to move well; the limits are {MIN_COMPONENT_KG:g} to {MAX_COMPONENT_KG:g} kg for a box,
  {MIN_DENSITY:g} to {MAX_DENSITY:g} kg/m^3 for its density, and {MIN_TOOL_KG:g} to {{payload}} kg for the tool.
- The tool ends within {MAX_EXTENT_M:g} m of its mount. It is rigid: it is an error if 1 N at any end would bend it by
  more than {MAX_BEND_M_N * 1000:g} mm even if it were of steel, as it would a bar of 2 mm thickness and 0.25 m length.
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

_ELITES = """
The elites show `components` in its place, a line for each box: the name of its link, its parent link, its size, `at`
the xyz and rpy (none: 0 0 0) of its joint's origin, its mass. A box is centred on its link's frame. Yours are URDF."""

_RIGID_MOUNT = """\
The tool is rigid and takes the place of the hand. It hangs from the link `tool_mount` on the arm's flange, whose
axes are the world's when its roll, pitch and yaw are 0, as they are at home: x forward, y left, z up. The arm is above
it, so the tool extends toward -z. What hangs from `tool_mount` must touch the flange, a disc of
{diameter:g} mm diameter and {thickness:g} mm thickness centred at its origin and square to z."""

_GRIPPER_MOUNT = """\
The tool is a pair of attachments to the gripper's fingers, which open and close them: the left part hangs from the link
`left_finger`, the right part from `right_finger`; each must touch its finger. In both frames z points along
the finger to its tip at z = 0.054, and x across it (the finger is 0.022 wide). The left finger lies on the +y side of
its frame and opens toward +y, the right one lies on the -y side and opens toward -y; both inner faces are at y = 0, and
meet when the gripper is closed. At home both frames' x is the world's x, their y is the world's -y, and their z is
down."""


def _example(gripper: bool) -> str:
    mount = "left_finger" if gripper else "tool_mount"
    joint_origin = "0 0.0075 0.07" if gripper else "0 0 -0.055"
    name, size = ("left_pad", "0.02 0.015 0.04") if gripper else ("shaft", "0.02 0.02 0.1")
    return f"""\
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
  <origin xyz="{joint_origin}" rpy="0 0 0"/>
</joint>"""

"""Tools as URDF: the block of links and joints that is merged into the robot's own description."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from core.design import Component, DesignError, Tool, ToolJoint
from core.designs.rules import (
    MAX_BEND_M_N,
    MAX_COMPONENT_KG,
    MAX_COMPONENTS,
    MAX_DENSITY,
    MAX_EXTENT_M,
    MAX_SIDE_M,
    MIN_COMPONENT_KG,
    MIN_DENSITY,
    MIN_SIDE_M,
    MIN_TOOL_KG,
)
from core.designs.statics import MAX_GAP_M, MAX_HZ, MAX_JOINTS, MIN_MOVED_KG
from core.interfaces import Brief
from core.robot.description import tool_urdf
from core.support.text import kind, short_numbers
from plugins.tools.components import describe_springs, weight_rules
from plugins.tools.mounting import describe_mount, first_box
from plugins.tools.urdf.building import build_tool
from plugins.tools.varying import VariedTools


class UrdfTools(VariedTools):
    """A tool is one field, ``tool_urdf``: URDF links and joints of boxes that hang from the mount.

    With ``joints`` links may hang on revolute and prismatic joints, with a spring in an element of our own.
    """

    def __init__(self, joints: bool = False) -> None:
        self.joints = joints

    def schema(self) -> dict[str, Any]:
        description = "URDF <link> and <joint> elements of the tool, without a root element"
        return {"tool_urdf": {"type": "string", "description": description}}

    def parse(self, data: Mapping[str, Any], *, gripper: bool) -> Tool:
        if "tool_urdf" not in data:
            raise DesignError("tool_urdf is missing; give the tool's <link> and <joint> elements")
        text = data["tool_urdf"]
        if not isinstance(text, str):
            raise DesignError(f"tool_urdf must be a text of <link> and <joint> elements, not {kind(text)}")
        masses = self.material.density_kg_m3 is None
        return build_tool(text, gripper, self.robot, masses=masses, loose=self.joints)

    def dump(self, tool: Tool) -> dict[str, Any]:
        return {"tool_urdf": tool_urdf(tool)}

    def abridge(self, tool: Tool) -> dict[str, Any]:
        return {"components": [_line(component) for component in tool.components]}

    def instructions(self, brief: Brief) -> str:
        mount, name, size, at = first_box(brief)
        example = _EXAMPLE.format(mount=mount, name=name, size=short_numbers(size, 4), at=short_numbers(at, 4))
        given = self.material.density_kg_m3 is not None
        weight, bend = weight_rules(self.material, brief.task.robot, _MASSES)
        return (_RULES if self.joints else _RULES.replace(_LOOSE, "")).format(
            mount=describe_mount(brief),
            elites=_ELITES if brief.elites else "",
            parts="a collision element" if given else "a collision and an inertial element",
            weight=weight,
            bend=bend,
            springs=describe_springs(self.material).replace("`rest`", "rest"),
            example=_LIGHT.sub("", example) if given else example,
        )


_LOOSE = f"""\
- A link may also hang on a joint of type "revolute" or "prismatic", which has no motor and moves the first box of the
  link with all that hangs from it: <axis xyz="x y z"/> in the joint's frame; <limit lower="..." upper="..."/> in
  radians or metres around 0, the pose that the origin gives; <dynamics damping="..." friction="..."/> with dry
  friction in N m or N; <spring stiffness="..." rest="..."/> in N m/rad or N/m. At most {MAX_JOINTS}. What a spring
  moves may swing at {MAX_HZ:g} Hz at most, and must weigh {1000 * MIN_MOVED_KG:g} g at least. {{springs}}.
  It passes through its parent, and touches everything else. Over the whole range, what moves on the joint touches what
  bears it: give a prismatic joint a rail, a box of its own or of its parent. It is held at 0 until
  the motion begins.
"""

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
{_LOOSE}\
- Every box touches or overlaps its parent; a gap of more than {MAX_GAP_M * 1000:g} mm is an error. Gaps are measured
  between the surfaces of the boxes as they are turned, not between boxes around them.
- Names: letters, digits, '_', '.', '-'; each link and each joint has its own.
- Colours are welcome: <material name="..."><color rgba="r g b a"/></material> in the collision, numbers from 0 to 1.
- Tools of several well-placed boxes (hooks, walls, scoops, bends) tend to do better than a plain bar.

Example of one link and its joint:
{{example}}"""

_MASSES = f"""\
- The inertial needs <mass value="..."/> in kilograms; moments of inertia are computed from the box. A few grams per
  box help the arm to move well; the limits are {MIN_COMPONENT_KG:g} to {MAX_COMPONENT_KG:g} kg for a box,
  {MIN_DENSITY:g} to {MAX_DENSITY:g} kg/m^3 for its density, and {MIN_TOOL_KG:g} to {{payload}} kg for the tool."""
_LIGHT = re.compile(r"  <inertial>.*</inertial>\n")  # of the example

_ELITES = """
The elites show `components` in its place, a line for each box: the name of its link, its parent link, its size, `at`
the xyz and rpy (none: 0 0 0) of its joint's origin, its mass. A box is centred on its link's frame. Yours are URDF."""

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


def _line(component: Component) -> str:
    """Write name, parent, size, place in the parent's frame (no rpy: not turned), mass, and how it moves."""
    pose, size = component.pose, component.shape.bounds[1]
    xyz, rpy = short_numbers(pose.position, 4), short_numbers(pose.rpy, 4)
    turn = f" rpy {rpy}" if rpy != "0 0 0" else ""
    moves = f", {_moves(component.joint)}" if component.joint else ""
    mass = f"{component.mass:.3g} kg{moves}"
    return f"{component.name} on {component.parent}: {short_numbers(size, 4)} at {xyz}{turn}, {mass}"


def _moves(joint: ToolJoint) -> str:
    """Write a joint in the component's frame."""
    at = f" at {short_numbers(joint.origin, 4)}" if joint.kind == "hinge" else ""
    spring = f", spring {joint.stiffness:.3g} relaxed at {joint.rest:g}" if joint.stiffness else ""
    resists = f", damping {joint.damping:.3g}, friction {joint.friction:.3g}"
    return f"{joint.kind} along {short_numbers(joint.axis, 4)}{at}, {joint.lower:g} to {joint.upper:g}{resists}{spring}"

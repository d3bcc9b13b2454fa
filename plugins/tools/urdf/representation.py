"""Tools as URDF: the block of links and joints that is merged into the robot's own description."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from core.design import DesignError, Tool
from core.designs.elites import component_lines
from core.designs.mounting import describe_mount, first_box
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
from core.designs.tool_joints import MAX_HZ, MAX_JOINTS, MIN_MOVED_KG
from core.designs.varying import VariedTools
from core.designs.weight import describe_weight, mass_limit
from core.errors import UsageError, choices
from core.interfaces import Brief
from core.robot.description import tool_urdf
from core.support.text import kind, short_numbers
from plugins.tools.urdf.building import SHAPES, build_tool
from plugins.tools.urdf.parsing import parse_xml


class UrdfTools(VariedTools):
    """A tool is one field, ``tool_urdf``: URDF links and joints of boxes that hang from the mount.

    ``shapes`` may add cylinder, sphere and capsule, which URDF lacks, to the box. With ``joints`` links may hang on
    revolute and prismatic joints, with a spring in an element of our own.

    Raises:
        UserError: ``shapes`` is empty, or names something else.
    """

    def __init__(self, shapes: list[str] = ["box"], joints: bool = False) -> None:  # noqa: B006 - a setting's default
        if not shapes:
            raise UsageError(f"tool.shapes is empty; give some of {', '.join(SHAPES)}")
        for shape in shapes:
            if shape not in SHAPES:
                raise choices("shape", str(shape), SHAPES, "tool.shapes")
        self.shapes = tuple(dict.fromkeys(shapes))
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
        return build_tool(parse_xml(text), gripper, self.robot, self.shapes, masses=masses, loose=self.joints)

    def dump(self, tool: Tool) -> dict[str, Any]:
        return {"tool_urdf": tool_urdf(tool, capsules=True)}

    def abridge(self, tool: Tool) -> dict[str, Any]:
        return {"components": component_lines(tool)}

    def instructions(self, brief: Brief) -> str:
        robot, elites = brief.task.robot, _ELITES if brief.elites else ""
        mount, example = describe_mount(brief), _example(brief)
        shapes = _BOXES_ONLY
        if self.shapes != ("box",):
            shapes = _SEVERAL.format(shapes=", ".join(map(_tag, self.shapes)))
        if self.material.density_kg_m3 is None:
            parts, weight = _INERTIAL, _MASSES.format(payload=f"{mass_limit(robot, self.material)[0]:g}")
            bend = "even if it were of steel, as it would a bar of 2 mm thickness and 0.25 m length"
        else:
            parts, weight = "a collision element", describe_weight(self.material, robot)
            example = _LIGHT.sub("", example)
            bend = f"or {MAX_LOAD_N:g} N would break it"
        rules = _RULES if self.joints else _RULES.replace(_LOOSE, "")
        return rules.format(
            mount=mount, elites=elites, shapes=shapes, parts=parts, weight=weight, bend=bend, example=example
        )


_LOOSE = f"""\
- A link may also hang on a joint of type "revolute" or "prismatic", which has no motor and moves the first box of the
  link with all that hangs from it: <axis xyz="x y z"/> in the joint's frame; <limit lower="..." upper="..."/> in
  radians or metres around 0, the pose that the origin gives; <dynamics damping="..." friction="..."/> with dry
  friction in N m or N; <spring stiffness="..." rest="..."/> in N m/rad or N/m. At most {MAX_JOINTS}. What a spring
  moves may swing at {MAX_HZ:g} Hz at most, and must weigh {1000 * MIN_MOVED_KG:g} g at least. It passes through its
  parent, and touches everything else.
"""

_RULES = f"""\
Write each tool as a block of URDF <link> and <joint> elements in `tool_urdf`. The block is merged into the robot's URDF
before its closing tag, so it has no root element and none of the robot's own links or joints.{{elites}}

{{mount}}

{{shapes}}
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

_INERTIAL = "a collision and an inertial element"
_MASSES = f"""\
- The inertial needs <mass value="..."/> in kilograms; moments of inertia are computed from the box. A few grams per
  box help the arm to move well; the limits are {MIN_COMPONENT_KG:g} to {MAX_COMPONENT_KG:g} kg for a box,
  {MIN_DENSITY:g} to {MAX_DENSITY:g} kg/m^3 for its density, and {MIN_TOOL_KG:g} to {{payload}} kg for the tool."""
_LIGHT = re.compile(r"  <inertial>.*</inertial>\n")  # of the example

_BOXES_ONLY = f"""\
- Boxes only: <box size="x y z"/>, full side lengths in metres, each {MIN_SIDE_M:g} to {MAX_SIDE_M:g}. No meshes,
  cylinders or spheres."""

_SEVERAL = f"""\
- Shapes: {{shapes}}; metres, every side or diameter
  {MIN_SIDE_M:g} to {MAX_SIDE_M:g}. A box has full side lengths; a cylinder or capsule lies along its z,
  and the length of a capsule leaves out its round ends. No meshes. Below, "box" stands for each of these shapes."""

_ELITES = """
The elites show `components` in its place, a line for each box: the name of its link, its parent link, its size, `at`
the xyz and rpy (none: 0 0 0) of its joint's origin, its mass. A box is centred on its link's frame. Yours are URDF."""


def _tag(shape: str) -> str:
    return f"<{SHAPES[shape][0]}/>"


def _example(brief: Brief) -> str:
    mount, name, size, at = first_box(brief)
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

"""Tools as components of any form, each a tree of shapes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from core.design import DesignError, Tool
from core.designs.components import (
    component_rules,
    component_schema,
    read_components,
    rounded,
    short_components,
    write_components,
)
from core.designs.mounting import describe_mount, first_box
from core.designs.rules import MAX_COMPONENTS, MIN_SIDE_M
from core.designs.varying import VariedTools
from core.geometry import Box, Compound, Pose, Shape
from core.interfaces import Brief
from plugins.tools.solids.building import MAX_TRIANGLES, count_triangles
from plugins.tools.solids.making import MAX_PARTS, WITHIN_M, make_shape, node_of
from plugins.tools.solids.reading import MAX_NODES, MAX_POINTS, MAX_SIZE_M, SIZES, Node, TreeReader, dump_node

FIELD = "tool_solids"


class SolidTools(VariedTools):
    """A tool is one field, ``tool_solids``: components, each with a tree of shapes as JSON text.

    The tree is a text because no schema of a tree is accepted everywhere. A tree needs a schema that refers to itself:
    OpenAI's strict mode takes one, Anthropic's refuses it, and Gemini unrolls it a few levels. Nested without
    references, a tree of ten kinds of nodes and depth 4 has ten thousand. A text is accepted by all; values in its
    place, as a model without a strict schema may write them, are read as well. With ``joints`` components may move
    against their parents.
    """

    shapes = ("box", "cylinder", "capsule", "sphere")

    def __init__(self, joints: bool = False) -> None:
        self.joints = joints

    def schema(self) -> dict[str, Any]:
        solid = {"solid": {"type": "string", "description": "the tree of shapes, as JSON"}}
        return {FIELD: {"type": "array", "items": component_schema(solid, self.joints)}}

    def parse(self, data: Mapping[str, Any], *, gripper: bool) -> Tool:
        reader = _Reader()
        read_components(data, FIELD, ("solid",), reader.read, self.robot, gripper, self.joints)
        return read_components(data, FIELD, ("solid",), reader.make, self.robot, gripper, self.joints)

    def dump(self, tool: Tool) -> dict[str, Any]:
        return {FIELD: write_components(tool, _write_solid, self.joints)}

    def abridge(self, tool: Tool) -> dict[str, Any]:
        return {FIELD: short_components(self.dump(tool)[FIELD])}

    def instructions(self, brief: Brief) -> str:
        mount, name, size, at = first_box(brief)
        hole = {"cylinder": [0.003, 0.1], "at": [0, 0, 0.005, 1.5708, 0, 0]}
        solid = {"difference": [{"box": rounded(size)}, hole]}
        example: dict[str, Any] = {"name": name, "parent": mount, "solid": json.dumps(solid), "position": rounded(at)}
        example |= {"rpy": [0, 0, 0], "mass": 0.005, "color": "#3373cc"}
        return _RULES.format(
            mount=describe_mount(brief),
            rules=component_rules(brief.task.robot, brief.gripper, self.material, self.joints),
            example=json.dumps([example]),
        )


_RULES = f"""\
Write each tool as a list of components in `{FIELD}`, at most {MAX_COMPONENTS}.

{{mount}}

Each component is an object with these keys:
- `solid`: its shape, a tree written as JSON text. A node is an object with one of these keys; lengths in metres from
  {MIN_SIDE_M:g} to {MAX_SIZE_M:g}, angles in radians:
  "box": [x, y, z], full side lengths; "sphere": radius; "cylinder": [radius, length], along z; "capsule": the same with
  half a sphere added at each end; "cone": [bottom radius, top radius, length], along z. All are centred.
  "extrude": [[x, y], ...], an outline's corners in order, with "height": along z, centred on z = 0.
  "revolve": [[r, z], ...], an outline turned about the z axis, r from 0, with "angle": from the x axis, a full turn
  if left out.
  "hull": [[x, y, z], ...], the convex hull of points.
  "union", "difference" (the first less all others), "intersection": a list of nodes.
  "at": [x, y, z] or [x, y, z, roll, pitch, yaw] moves and turns any node in the frame of the node above it; for the
  topmost node that is the component's own frame.
  A tool has at most {MAX_NODES} nodes, an outline at most {MAX_POINTS} corners, and a component is of one piece.
{{rules}}
- What is not convex collides as convex parts that keep within {WITHIN_M * 1000:g} mm of the solid, at most {MAX_PARTS}
  for a tool. Flat walls need few parts, deep round bowls many: one of 3 mm wall fits up to about 50 mm of radius.

Example of a list with one component, a bar with a hole across:
{{example}}"""


class _Reader:
    """Reads the trees of one tool and counts their triangles, then makes the shapes and counts their parts."""

    def __init__(self) -> None:
        self._reader, self._trees = TreeReader(), dict[str, Node]()
        self._triangles, self._parts = 0, 0

    def read(self, item: Mapping[str, Any], where: str) -> tuple[Shape | Compound, Pose]:
        """Read a tree; what is returned stands in for its shape."""
        node = self._trees[where] = self._reader.read(item.get("solid"), f"{where}: solid")
        self._triangles += count_triangles(node) if node.kind not in SIZES else 0
        if self._triangles > MAX_TRIANGLES:
            raise DesignError(
                f"{where}: with it the tool's solids have {self._triangles} triangles; at most {MAX_TRIANGLES} are "
                "allowed: use fewer or smaller spheres and revolutions (a whole component that is one sphere is free)"
            )
        return Box((1.0, 1.0, 1.0)), Pose()

    def make(self, item: Mapping[str, Any], where: str) -> tuple[Shape | Compound, Pose]:
        try:
            shape, pose = make_shape(self._trees[where], MAX_PARTS - self._parts)
        except DesignError as error:
            raise DesignError(f"{where}: its solid {error}") from error
        self._parts += len(shape.parts) if isinstance(shape, Compound) else 0
        return shape, pose


def _write_solid(shape: Shape | Compound, where: str) -> dict[str, Any]:
    return {"solid": json.dumps(dump_node(node_of(shape)), separators=(",", ":"))}

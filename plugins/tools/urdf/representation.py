"""Tools as URDF: the block of links and joints that is merged into the robot's own description."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from core.design import DesignError, Tool
from core.interfaces import Brief, JsonObject
from core.robot.description import tool_urdf
from core.support.templates import fill
from core.support.text import kind, short_numbers
from plugins.tools.mounting import first_box, instruct
from plugins.tools.refusals import ToolReason
from plugins.tools.urdf.building import build_tool
from plugins.tools.varying import VariedTools


class UrdfTools(VariedTools):
    """A tool is one field, ``tool_urdf``: URDF links and joints of boxes that hang from the mount.

    With ``joints`` links may hang on revolute and prismatic joints, with a spring in an element of our own.
    """

    def __init__(self, joints: bool = False) -> None:
        self.joints = joints

    def schema(self) -> JsonObject:
        description = (
            "URDF <link> and <joint> elements of the tool, without a root element"
        )
        return {"tool_urdf": {"type": "string", "description": description}}

    def parse(self, data: Mapping[str, Any], *, gripper: bool) -> Tool:
        if "tool_urdf" not in data:
            wanted = "the tool's <link> and <joint> elements"
            raise DesignError.because(
                ToolReason.FIELD_MISSING, field="tool_urdf", wanted=wanted
            )
        text = data["tool_urdf"]
        if not isinstance(text, str):
            raise DesignError.because(
                ToolReason.FIELD_TEXT, field="tool_urdf", given=kind(text)
            )
        masses = self.material.density_kg_m3 is None
        return build_tool(text, gripper, self.robot, masses=masses, loose=self.joints)

    def dump(self, tool: Tool) -> JsonObject:
        return {"tool_urdf": tool_urdf(tool)}

    def abridge(self, tool: Tool) -> JsonObject:
        """Write a line for each component: in its parent's frame where it is, in its own how it moves.

        Masses follow where they are asked for: one number, if all components have it.
        """
        lines = [
            fill("plugins.tools", "line", part=component, short=short_numbers)
            for component in tool.components
        ]
        if self.material.density_kg_m3 is not None:
            return {"components": lines}

        masses = [float(f"{component.mass:.3g}") for component in tool.components]
        alike = len(set(masses)) == 1
        return {"components": lines, "mass_kg": masses[0] if alike else masses}

    def instructions(self, brief: Brief) -> str:
        box = first_box(brief)
        return instruct(
            "urdf",
            brief,
            self.material,
            link=box.mount,
            name=box.name,
            size=short_numbers(box.size, 4),
            at=short_numbers(box.place, 4),
            joints=self.joints,
        )

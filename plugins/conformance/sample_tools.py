"""Provide tools of boxes for checks, and a representation that writes any tool as one number."""

from __future__ import annotations

from typing import Any

from core.design import RIGID_MOUNT, Component, Tool
from core.geometry import Box, Pose, Vector
from core.interfaces import Brief, ToolRepresentation


def box(
    name: str,
    size: tuple[float, float, float],
    position: Vector,
    mount: str = RIGID_MOUNT,
    **more: Any,
) -> Component:
    """A box of a tool."""
    return Component(name, mount, Pose.xyz_rpy(position), Box(size), **more)


def stick(length: float, mass: float = 0.005) -> Tool:
    """A rigid tool: a box 0.02 m wide that hangs down from the flange."""
    middle = (0.0, 0.0, -length / 2)
    return Tool((box("stick", (0.02, 0.02, length), middle, mass=mass),))


def rigid() -> Tool:
    """An L of two boxes under the flange."""
    down = box("down", (0.02, 0.02, 0.2), (0.0, 0.0, -0.1))
    turned = Pose.xyz_rpy((0.05, 0.0, -0.1), (0.0, 0.0, 0.2))
    ahead = Component("ahead", "down", turned, Box((0.1, 0.02, 0.02)))
    return Tool((down, ahead), name="L")


def fingers() -> Tool:
    """A box on each finger."""
    size = (0.01, 0.01, 0.05)
    left = box("tip_left", size, (0.0, 0.008, 0.06), "left_finger")
    right = box("tip_right", size, (0.0, -0.008, 0.06), "right_finger")
    return Tool((left, right), gripper=True, name="tips")


class LengthOnly(ToolRepresentation):
    """Writes any tool as one number, so that a model can be checked without a tool plugin."""

    def instructions(self, brief: Brief) -> str:
        return "`length`: of the stick, metres."

    def schema(self) -> dict[str, Any]:
        return {"length": {"type": "number"}}

    def parse(self, data: Any, *, gripper: bool) -> Tool:
        return fingers() if gripper else rigid()

    def dump(self, tool: Tool) -> dict[str, Any]:
        return {"length": 0.2}

"""Tools of boxes."""

from core.design import Component, Tool
from core.geometry import Box, Pose


def box(
    name="a",
    at=(0, 0, -0.05),
    size=(0.02, 0.02, 0.1),
    *,
    parent="tool_mount",
    mass=0.005,
    rpy=(0, 0, 0),
):
    return Component(name, parent, Pose.xyz_rpy(at, rpy), Box(size), mass)


def rigid(*components):
    return Tool(components or (box(),))


LENGTH_M = 0.2


def hanging(shape):
    """A tool that reaches down from the flange, to its tip."""
    pose = Pose.xyz_rpy((0, 0, -LENGTH_M / 2))
    return rigid(Component("blade", "tool_mount", pose, shape, 0.05))

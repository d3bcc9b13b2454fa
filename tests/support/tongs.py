"""A tool with sprung joints that tests share."""

from core.design import Component, Tool, ToolJoint
from core.geometry import Box, Pose
from core.scene import Body, Geom
from plugins.conformance.sample_tools import box

JAW, GAP, THICK = 0.12, 0.034, 0.006  # of the jaws: length, distance and thickness


def tongs(lower=0.0):
    """Two sprung jaws that hang from a bar, 34 mm apart, their ends bent outward; they close as far as ``lower``."""
    components = [box("bar", (0.04, 0.06, 0.016), (0.0, 0.0, -0.012), mass=0.03)]
    for name, side in (("left", 1.0), ("right", -1.0)):
        at = (0.0, side * (GAP + THICK) / 2, -0.008 - JAW / 2)
        joint = ToolJoint(
            "hinge", (side, 0, 0), lower, 1.0, (0, 0, JAW / 2), 0.01, 0.0, 0.5, -0.4
        )
        components.append(
            box(name, (0.03, THICK, JAW), at, "bar", mass=0.03, joint=joint)
        )
        bent = Pose.xyz_rpy(
            (0.0, side * 0.006, -JAW / 2 - 0.005), (side * 0.8, 0.0, 0.0)
        )
        components.append(
            Component(f"{name}_end", name, bent, Box((0.03, 0.003, 0.02)), 0.005)
        )
    return Tool(tuple(components))


def hammer(name, at, side=0.05):
    """A body whose centre of mass is not its frame's origin, and whose axes of inertia are not its own."""
    parts = (
        Geom(Box((side, 0.02, 0.02)), Pose.xyz_rpy((0.03, 0.01, 0), (0.2, 0.3, 0.4))),
        Geom(Box((0.03, side, 0.04)), Pose.xyz_rpy((0, 0, 0.02))),
    )
    return Body(name, Pose.xyz_rpy(at, (0.3, 0, 0.5)), 0.2, parts, parts)

"""Take a tool apart into its links: the rigid bodies that mounts and joints bear.

Lengths are metres, in the frame of the mount, with all joints at 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Tool, ToolJoint
from core.geometry import Array, Compound, Pose, resized
from plugins.results.workshop.solid import Placed

NAMES = {RIGID_MOUNT: "tool", GRIPPER_MOUNTS[0]: "left", GRIPPER_MOUNTS[1]: "right"}  # others have their joints' names

# By how much each side of a component is moved out, so that components that touch, or nearly do, become one body: the
# least that does it. A design may have gaps of up to 1 mm (`core.designs.rules`), so that 0.5 mm is enough.
WELDS_MM = (0.01, 0.05, 0.1, 0.25, 0.5)


@dataclass(frozen=True, eq=False)
class ToolLink:
    """A rigid body of a tool.

    Attributes:
        bearer: the mount that bears it, or the component with the joint that moves it.
        mount: the frame of its shapes.
        names: of its components.
        shapes: of its components, and their poses.
        parent: the bearer of the link that it moves on; with ``joint``.
        joint: what moves it; ``frame`` is its place.
    """

    bearer: str
    mount: str
    names: tuple[str, ...]
    shapes: tuple[Placed, ...]
    parent: str = ""
    joint: ToolJoint | None = None
    frame: Pose = field(default_factory=Pose)

    @property
    def name(self) -> str:
        return NAMES.get(self.bearer, self.bearer)

    @property
    def axes(self) -> Array:
        """The directions (3 K, 3) of K components, to which cuts are square."""
        return np.vstack([pose.rotation.as_matrix().T for _, pose in self.shapes])

    def grown(self, by: float) -> list[Placed]:
        """Return its shapes with each side moved out by millimetres."""
        return widened(self.shapes, by)


def links_of(tool: Tool) -> list[ToolLink]:
    """Return the links of a tool, in the order of their first components."""
    placed, links = tool.placed(), list[ToolLink]()
    components, joints = {c.name: c for c in tool.components}, {of.name: of for of in tool.bearers}
    for bearer in dict.fromkeys(bearer for bearer, _ in tool.borne.values()):
        own = [name for name in components if tool.borne[name][0] == bearer]
        shapes = tuple((components[name].shape, placed[name][1]) for name in own)
        moved: tuple[Any, ...] = ()
        if bearer in joints:
            moved = joints[bearer].parent, joints[bearer].joint, placed[bearer][1] @ components[bearer].link
        links.append(ToolLink(bearer, placed[own[0]][0], tuple(own), shapes, *moved))
    return links


def widened(shapes: Sequence[Placed], by: float) -> list[Placed]:
    """Move each side of shapes out by millimetres; by little, what is hollow stays: its inner walls would move, too."""
    stays = by <= WELDS_MM[0]
    return [
        (shape if stays and isinstance(shape, Compound) else resized(shape, shape.bounds[1] + 0.002 * by), pose)
        for shape, pose in shapes
    ]

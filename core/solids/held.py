"""Make solids of components, by their mounts and as the arm holds them.

Covered by `tests/plugins/results/test_gallery.py`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from core.design import Component, Tool
from core.interfaces import Robot
from core.robot.frames import open_mounts

if TYPE_CHECKING:
    import trimesh


def solids(tool: Tool, *, loose: bool = False) -> dict[str, list[tuple[Component, trimesh.Trimesh]]]:
    """The components by mount, each with its solid in the mount's frame, in metres.

    If ``loose``, by what bears them: a mount or, for those that a joint moves, the component with the joint.
    """
    placed = tool.borne if loose else tool.placed()
    by_mount: dict[str, list[tuple[Component, trimesh.Trimesh]]] = {}
    for component in tool.components:
        mount, pose = placed[component.name]
        by_mount.setdefault(mount, []).append((component, component.shape.to_trimesh().apply_transform(pose.matrix)))
    return by_mount


def as_held(tool: Tool, robot: Robot) -> list[tuple[Component, trimesh.Trimesh]]:
    """The components as the arm holds them at home: x forward, y left, z up, in metres from the flange."""
    mounts = open_mounts(robot, True) if tool.gripper else {}
    held = []
    for mount, placed in solids(tool).items():
        for component, solid in placed:
            held.append((component, solid.apply_transform(mounts[mount].matrix) if mount in mounts else solid))
    return held

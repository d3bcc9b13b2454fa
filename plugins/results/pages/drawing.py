"""A tool as solids with colours, as the arm holds it."""

from __future__ import annotations

from dataclasses import dataclass

import trimesh

from core.design import Component, Tool
from core.geometry import Box, Color, Pose
from core.robot.extents import fingers_of
from core.robot.kinematics import open_mounts
from core.values.robots import Robot

ROBOT: Color = (0.62, 0.64, 0.68, 1.0)


@dataclass(frozen=True, eq=False)
class Painted:
    """A solid and its colour."""

    solid: trimesh.Trimesh
    color: Color


def painted(tool: Tool, robot: Robot) -> list[Painted]:
    """A tool as the arm holds it at home, with the flange or the fingers that carry it in grey."""
    solids = _fingers(robot) if tool.gripper else [robot.flange.disc.to_trimesh()]
    bearing = [Painted(solid, ROBOT) for solid in solids]
    held = as_held(tool, robot)
    return [*bearing, *(Painted(solid, component.color) for component, solid in held)]


def _fingers(robot: Robot) -> list[trimesh.Trimesh]:
    """Draw each finger of the open gripper as the box around it."""
    solids = []
    for finger in fingers_of(robot):
        lowest, highest = finger.extent
        pose = finger.pose @ Pose((lowest + highest) / 2)
        box = Box.of(*(highest - lowest))
        solids.append(box.to_trimesh().apply_transform(pose.matrix))

    return solids


def as_held(tool: Tool, robot: Robot) -> list[tuple[Component, trimesh.Trimesh]]:
    """The components as the arm holds them at home: x forward, y left, z up, in metres from the flange."""
    mounts = open_mounts(robot, True) if tool.gripper else {}
    placed = tool.placed()
    held = []
    for component in tool.components:
        mount, pose = placed[component.name]
        solid = component.shape.to_trimesh().apply_transform(pose.matrix)
        if mount in mounts:
            solid.apply_transform(mounts[mount].matrix)

        held.append((component, solid))

    return held

"""A tool as solids with colours, as the arm holds it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from core.design import GRIPPER_MOUNTS, Component, Tool
from core.geometry import Box, Color, Pose
from core.robot.kinematics import open_mounts
from core.values.robots import Robot

ROBOT: Color = (0.62, 0.64, 0.68, 1.0)
FINGER = Box((0.021, 0.012, 0.054))  # a finger, roughly


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
    """The two fingers of the open gripper, roughly: each ends at its mount, and lies outside of it."""
    mounts = open_mounts(robot, True)
    left, right = (mounts[name] for name in GRIPPER_MOUNTS)
    apart = left.position - right.position
    outward = apart / np.linalg.norm(apart) * FINGER.size[1] / 2
    solids = []
    for mount, side in ((left, 1), (right, -1)):
        middle = mount.apply((0.0, 0.0, FINGER.size[2] / 2)) + side * outward
        solids.append(FINGER.to_trimesh().apply_transform(Pose(middle).matrix))

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

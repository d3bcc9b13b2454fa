"""A tool as solids with colours, as the arm holds it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from core.design import GRIPPER_MOUNTS, Component, Tool
from core.geometry import Box, Pose
from core.robot.kinematics import open_mounts
from core.robot.meshes import solids as solids_of
from core.values.robots import Robot

Color = tuple[float, float, float, float]

ROBOT: Color = (0.62, 0.64, 0.68, 1.0)
FINGER = Box((0.021, 0.012, 0.054))  # a finger, roughly


@dataclass(frozen=True, eq=False)
class Painted:
    """A solid and its colour."""

    solid: trimesh.Trimesh
    color: Color


def painted(tool: Tool, robot: Robot) -> list[Painted]:
    """A tool as the arm holds it at home, with the flange or the fingers that carry it in grey."""
    if tool.gripper:
        fingers = [
            pose
            for mount, pose in open_mounts(robot, True).items()
            if mount in GRIPPER_MOUNTS
        ]
        apart = fingers[0].position - fingers[1].position
        outward = apart / np.linalg.norm(apart) * FINGER.size[1] / 2
        tips = [pose.apply((0.0, 0.0, FINGER.size[2] / 2)) for pose in fingers]
        places = [
            Pose(tip + side * outward) for tip, side in zip(tips, (1, -1), strict=True)
        ]
        bearing = [
            Painted(FINGER.to_trimesh().apply_transform(pose.matrix), ROBOT)
            for pose in places
        ]
    else:
        bearing = [Painted(robot.flange.disc.to_trimesh(), ROBOT)]
    return [
        *bearing,
        *(Painted(solid, component.color) for component, solid in as_held(tool, robot)),
    ]


def as_held(tool: Tool, robot: Robot) -> list[tuple[Component, trimesh.Trimesh]]:
    """The components as the arm holds them at home: x forward, y left, z up, in metres from the flange."""
    mounts = open_mounts(robot, True) if tool.gripper else {}
    held = []
    for mount, placed in solids_of(tool).items():
        for component, solid in placed:
            held.append(
                (
                    component,
                    solid.apply_transform(mounts[mount].matrix)
                    if mount in mounts
                    else solid,
                )
            )
    return held

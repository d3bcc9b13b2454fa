"""Measure the solids of a rollout: the robot's links, the tool's components and the scene's bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import chain

import numpy as np

from core.design import Tool
from core.robot.kinematics import RobotModel, jointed, robot_model
from core.robot.solids import (
    WORLD,
    Solid,
    body_solids,
    bounding_box,
    robot_solids,
    solid_geometry,
)
from core.scene import Scene
from core.values.robots import Robot

ROBOT = "the robot"  # the owner of its links and of the tool


class Solids:
    """N solids, each at rest in one of the frames that move, or in the world.

    What can be known of them before they move stands here once, so that `follow` only places them.

    Attributes:
        items: the solids.
        owners: (N,) the name of what each one is part of.
        frames: (N,) the number of the frame that each one moves with.
        moving: the numbers of those that move.
        rotations: (N, 3, 3), with ``positions`` (N, 3) its place in its frame.
        middles: (N, 3), with ``halves`` (N, 3) its bounding box along its own axes.
        widths: (N,) half of the thickness, metres (`thickness`).
        radii: (N,) that of a ball; infinite for others.
        reaches: (N,) how far from the solid's origin rotation moves a point, metres.
        far: (N,) how far from the origin of its frame it extends, metres.
    """

    def __init__(self, solids: Sequence[Solid]) -> None:
        self.items = tuple(solids)
        self.owners = np.array([solid.owner for solid in solids], dtype=str)
        self.frames = np.array([solid.frame for solid in solids], dtype=int)
        self.moving = np.flatnonzero(self.frames != WORLD)
        rotations = [solid.pose.rotation_matrix for solid in solids]
        self.rotations = np.reshape(rotations, (-1, 3, 3))
        self.positions = np.reshape([solid.pose.position for solid in solids], (-1, 3))

        boxes = [bounding_box(solid.geometry) for solid in solids]
        self.middles, self.halves = np.reshape(boxes, (-1, 2, 3)).swapaxes(0, 1)
        self.widths = self.halves.min(axis=1, initial=np.inf)
        self.radii = np.full(len(solids), np.inf)

        for number, solid in enumerate(solids):
            if solid.shape is not None:
                self.widths[number] = solid.shape.thickness / 2
                self.radii[number] = solid.shape.ball_radius

        corners = np.linalg.norm(np.abs(self.middles) + self.halves, axis=1)
        self.reaches = np.where(self.radii < np.inf, 0.0, corners)
        self.far = np.linalg.norm(self.positions, axis=1) + corners


@lru_cache(maxsize=8)
def link_solids(robot: Robot, tool: Tool) -> tuple[Solid, ...]:
    """Return the collision shapes of the links, each in its joint's frame.

    Args:
        robot: the arm, with its gripper if the tool hangs from that.
        tool: what `jointed` leaves of it.

    Returns:
        Solids whose frames are numbered as Pinocchio's joints; 0 is that of links that never move.
    """
    model = robot_model(robot, tool)
    solids = robot_solids(robot, tool.gripper)

    return tuple(_hang(solid, solid.name, model) for solid in solids)


def tool_solids(robot: Robot, tool: Tool) -> list[Solid]:
    """Return the solids of a tool's parts in the joints' frames, in the order of `Tool.parts`."""
    model = robot_model(robot, tool)
    solids = []

    for part in tool.parts:
        geometry = solid_geometry(part.shape)
        solid = Solid(part.component, geometry, part.pose, part.shape)
        solids.append(_hang(solid, part.bearer, model))

    return solids


def _hang(solid: Solid, link: str, model: RobotModel) -> Solid:
    """Move one of the robot's solids from a link's frame to that of the link's joint."""
    joint, pose = model.links[link]
    return replace(solid, pose=pose @ solid.pose, owner=ROBOT, frame=joint)


@lru_cache(maxsize=8)
def all_solids(scene: Scene, robot: Robot, tool: Tool) -> Solids:
    """Join the solids of the links that move, those of the tool's parts, and the collision shapes of all bodies.

    The frames of free bodies are numbered behind the joints.
    """
    links = [solid for solid in link_solids(robot, jointed(tool)) if solid.frame > 0]
    joints = robot_model(robot, tool).model.njoints
    frames = {body.name: joints + k for k, body in enumerate(scene.free)}
    bodies = [body_solids(body, frames.get(body.name, WORLD)) for body in scene.bodies]

    return Solids([*links, *tool_solids(robot, tool), *chain(*bodies)])

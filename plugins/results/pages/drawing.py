"""Pictures of solids without an engine or OpenGL: parallel projection, a depth buffer, flat shading, drawn edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import trimesh
from PIL import Image as Pillow
from scipy import ndimage

from core.design import GRIPPER_MOUNTS, Component, Tool
from core.geometry import Array, Box, Mesh, Pose
from core.robot.kinematics import open_mounts
from core.robot.meshes import solids as solids_of
from core.scene import Body, Camera, Geom
from core.simulation.pictures import nearness
from core.values.robots import Robot

Pixels = npt.NDArray[np.uint8]
Color = tuple[float, float, float, float]

EYE = (0.52, -0.742, 0.423)  # in front of the tool, to its right, above
ROBOT: Color = (0.62, 0.64, 0.68, 1.0)
FINGER = Box((0.021, 0.012, 0.054))  # a finger, roughly

_OVER = 2  # samples per pixel, along each side
_MARGIN = 0.06  # of the picture's smaller side
_AWAY_M = 10.0  # of the eye
_LIGHT = np.array([0.35, -0.45, 0.82]) / np.linalg.norm([0.35, -0.45, 0.82])
_EDGE = 0.25  # of the colour, where a surface ends
_BENT = 0.4  # change of the slope toward the eye from a sample to the next, from which an edge is drawn


@dataclass(frozen=True, eq=False)
class Painted:
    """A solid and its colour."""

    solid: trimesh.Trimesh
    color: Color


def painted(tool: Tool, robot: Robot) -> list[Painted]:
    """A tool as the arm holds it at home, with the flange or the fingers that carry it in grey."""
    if tool.gripper:
        fingers = [pose for mount, pose in open_mounts(robot, True).items() if mount in GRIPPER_MOUNTS]
        apart = fingers[0].position - fingers[1].position
        outward = apart / np.linalg.norm(apart) * FINGER.size[1] / 2
        tips = [pose.apply((0.0, 0.0, FINGER.size[2] / 2)) for pose in fingers]
        places = [Pose(tip + side * outward) for tip, side in zip(tips, (1, -1), strict=True)]
        bearing = [Painted(FINGER.to_trimesh().apply_transform(pose.matrix), ROBOT) for pose in places]
    else:
        bearing = [Painted(robot.flange.disc.to_trimesh(), ROBOT)]
    return [*bearing, *(Painted(solid, component.color) for component, solid in as_held(tool, robot))]


def as_held(tool: Tool, robot: Robot) -> list[tuple[Component, trimesh.Trimesh]]:
    """The components as the arm holds them at home: x forward, y left, z up, in metres from the flange."""
    mounts = open_mounts(robot, True) if tool.gripper else {}
    held = []
    for mount, placed in solids_of(tool).items():
        for component, solid in placed:
            held.append((component, solid.apply_transform(mounts[mount].matrix) if mount in mounts else solid))
    return held


def draw(
    solids: Sequence[Painted], width: int = 480, height: int = 360, eye: Sequence[float] = EYE, across_m: float = 0.0
) -> Pixels:
    """Draw a picture (height, width, 4) on a transparent ground, from the direction ``eye`` (3,).

    The solids fill it, or it shows ``across_m`` metres from left to right, with their middle in its own.
    """
    corners = np.concatenate([each.solid.vertices for each in solids])
    aside = Camera(tuple(_AWAY_M * np.asarray(eye)), (0.0, 0.0, 0.0)).axes
    low, high = (corners @ aside.T).min(axis=0), (corners @ aside.T).max(axis=0)
    middle, fine = (low + high) / 2 @ aside, (width * _OVER, height * _OVER)
    room = np.array([width, height]) - 2 * _MARGIN * min(width, height)
    per_m = width / across_m if across_m else float((room / np.maximum(high - low, 1e-9)[:2]).min())
    camera = Camera(tuple(middle + _AWAY_M * np.asarray(eye)), tuple(middle), height_m=height / per_m)
    near, front = np.full(fine[::-1], np.nan), np.full(fine[::-1], -1)
    for number, each in enumerate(solids):
        part = Geom(Mesh.from_trimesh(each.solid), Pose(), each.color)
        depth = nearness([Body("", Pose(), 0.0, (part,), ())], camera, *fine)
        front[~(depth <= near + 1e-6) & ~np.isnan(depth)] = number
        near = np.fmax(near, depth)
    return _shaded(near * per_m * _OVER, front, np.array([each.color[:3] for each in solids]), camera.axes)


def _shaded(near: Array, front: npt.NDArray[np.int_], colors: Array, axes: Array) -> Pixels:
    """Colour samples by the slope of what is in front, draw where it bends or ends, and take the mean of each pixel."""
    down, right = np.gradient(near)
    normals = np.dstack([-right, down, np.ones_like(near)])
    light = 0.7 + 0.3 * (normals @ (axes * [[1], [1], [-1]]) @ _LIGHT) / np.linalg.norm(normals, axis=-1)
    bends = ~(np.abs(ndimage.laplace(near)) < _BENT)  # where a solid ends, too: beyond it nothing is near
    edge = bends | (ndimage.laplace(front) != 0)
    shade = np.where(edge, _EDGE, np.nan_to_num(light, nan=0.7))
    color = np.clip(shade[..., None] * colors[front], 0.0, 1.0)
    samples = Pillow.fromarray((255 * np.dstack([color, front >= 0]) + 0.5).astype(np.uint8))
    return np.asarray(samples.reduce(_OVER))

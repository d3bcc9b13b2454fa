"""Pictures of solids without an engine or OpenGL: parallel projection, a depth buffer, flat shading, drawn edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import trimesh

from core.design import GRIPPER_MOUNTS, Tool
from core.geometry import Array, Box, Pose
from core.robot.kinematics import open_mounts
from core.robot.meshes import as_held
from core.values.robots import Robot

Pixels = npt.NDArray[np.uint8]
Color = tuple[float, float, float, float]

AZIMUTH, ELEVATION = np.deg2rad(-55.0), np.deg2rad(25.0)  # of the eye: in front of the tool, to its right, above
ROBOT: Color = (0.62, 0.64, 0.68, 1.0)
FINGER = Box((0.021, 0.012, 0.054))  # a finger, roughly

_OVER = 2  # samples per pixel, along each side
_MARGIN = 0.06  # of the picture's smaller side
_LIGHT = np.array([0.35, -0.45, 0.82]) / np.linalg.norm([0.35, -0.45, 0.82])
_EDGE = 0.25  # of the colour, where a surface ends
_SMOOTH = np.deg2rad(25.0)  # between two faces of one surface
_BEHIND = 0.05  # pixels by which a face must be nearer to cover another: of two in one plane the first stays


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


def draw(solids: Sequence[Painted], width: int = 480, height: int = 360) -> Pixels:
    """Draw a picture (height, width, 4) that the solids fill, on a transparent ground."""
    toward = np.array([np.cos(ELEVATION) * np.cos(AZIMUTH), np.cos(ELEVATION) * np.sin(AZIMUTH), np.sin(ELEVATION)])
    right = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0])
    axes = np.stack([right, np.cross(toward, right), toward])  # right, up, toward the eye
    corners = [np.asarray(each.solid.vertices) @ axes.T for each in solids]
    low, high = np.min([c.min(axis=0) for c in corners], axis=0), np.max([c.max(axis=0) for c in corners], axis=0)
    fine = np.array([width, height]) * _OVER
    room = fine - 2 * _MARGIN * fine.min()
    scale = float((room / np.maximum(high - low, 1e-9)[:2]).min())
    canvas = _Canvas(*fine[::-1])
    surfaces = 0
    for each, points in zip(solids, corners, strict=True):
        mesh, points = each.solid, (points - (low + high) / 2) * scale
        points[:, :2] += fine / 2
        smooth = mesh.face_adjacency[mesh.face_adjacency_angles < _SMOOTH]
        numbers = surfaces + trimesh.graph.connected_component_labels(smooth, node_count=len(mesh.faces))
        surfaces = int(numbers.max()) + 1
        light = 0.7 + 0.3 * np.asarray(mesh.face_normals) @ _LIGHT
        for k in np.flatnonzero(np.asarray(mesh.face_normals) @ toward > 1e-6):
            color = np.clip(light[k] * np.array(each.color[:3]), 0.0, 1.0)
            canvas.triangle(points[mesh.faces[k]], color, numbers[k])
    return canvas.picture()


class _Canvas:
    """The colour, depth and number of the surface in front, by pixel (height, width); row 0 is the lowest."""

    def __init__(self, height: int, width: int) -> None:
        self.color = np.zeros((height, width, 3))
        self.depth = np.full((height, width), -np.inf)
        self.surface = np.full((height, width), -1)

    def triangle(self, corners: Array, color: Array, surface: int) -> None:
        """Draw a triangle; corners (3, 3) are column, row, and depth toward the eye."""
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners.tolist()
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if abs(area) < 1e-9:
            return
        height, width = self.depth.shape
        x0, x1 = max(0, int(min(ax, bx, cx))), min(width, int(max(ax, bx, cx)) + 2)
        y0, y1 = max(0, int(min(ay, by, cy))), min(height, int(max(ay, by, cy)) + 2)
        x, y = np.meshgrid(np.arange(x0, x1) + 0.5, np.arange(y0, y1) + 0.5)
        b = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area
        c = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area
        depth = az + b * (bz - az) + c * (cz - az)
        window = np.s_[y0:y1, x0:x1]
        front = (b >= 0) & (c >= 0) & (b + c <= 1) & (depth > self.depth[window] + _BEHIND)
        self.color[window][front], self.surface[window][front], self.depth[window][front] = color, surface, depth[front]

    def picture(self) -> Pixels:
        """The picture with edges, at its final size, row 0 on top."""
        solid, edge = self.surface >= 0, np.zeros_like(self.surface, dtype=bool)
        edge[:, :-1] |= self.surface[:, :-1] != self.surface[:, 1:]
        edge[:-1] |= self.surface[:-1] != self.surface[1:]
        color = np.where((edge & solid)[..., None], self.color * _EDGE, self.color)
        height, width = solid.shape
        blocks = (height // _OVER, _OVER, width // _OVER, _OVER)
        cover = solid.reshape(blocks).mean(axis=(1, 3))
        mixed = (color * solid[..., None]).reshape(*blocks, 3).mean(axis=(1, 3)) / np.maximum(cover, 1e-9)[..., None]
        return (np.dstack([mixed, cover])[::-1] * 255 + 0.5).astype(np.uint8)

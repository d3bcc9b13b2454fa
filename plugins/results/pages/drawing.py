"""Pictures of solids without an engine or OpenGL: parallel projection, a depth buffer, flat shading, drawn edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from core.design import GRIPPER_MOUNTS, Tool
from core.geometry import Array, Box, Pose
from core.robot.frames import open_mounts
from core.solids.held import as_held
from core.values.robots import Robot

if TYPE_CHECKING:
    import trimesh

Pixels = npt.NDArray[np.uint8]
Color = tuple[float, float, float, float]

AZIMUTH, ELEVATION = np.deg2rad(-55.0), np.deg2rad(25.0)  # of the eye: in front of the tool, to its right, above
ROBOT: Color = (0.62, 0.64, 0.68, 1.0)
FINGER = Box((0.021, 0.012, 0.054))  # a finger, roughly

_OVER = 2  # samples per pixel, along each side
_MARGIN = 0.06  # of the picture's smaller side
_LIGHT = np.array([0.35, -0.45, 0.82])
_EDGE = 0.25  # of the colour, where a face ends
_STEP = 0.004  # of the picture's size: an edge is drawn where one of two parallel faces stands out more
_SMOOTH = 0.9  # cosine of the angle between two faces up to which no edge is drawn
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
    canvas = _Canvas(int(fine[0]), int(fine[1]))
    for number, (each, points) in enumerate(zip(solids, corners, strict=True)):
        points = (points - (low + high) / 2) * scale
        points[:, :2] += fine / 2
        normals = np.asarray(each.solid.face_normals)
        for face, normal in zip(np.asarray(each.solid.faces), normals, strict=True):
            if normal @ toward > 1e-6:
                canvas.triangle(points[face], _shade(each.color, normal), axes @ normal, number)
    return canvas.picture(_STEP * float(fine.min()))


def _shade(color: Color, normal: Array) -> Array:
    light = 0.7 + 0.3 * float(normal @ (_LIGHT / np.linalg.norm(_LIGHT)))
    return np.clip(np.array(color[:3]) * light, 0.0, 1.0)


class _Canvas:
    """The colour, normal, depth and number of the solid in front, by pixel (height, width, 8); row 0 is the lowest."""

    def __init__(self, width: int, height: int) -> None:
        self.pixels = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -np.inf, -1.0], (height, width, 1))

    def triangle(self, corners: Array, color: Array, normal: Array, number: int) -> None:
        """Draw a triangle; corners (3, 3) and normal (3,) are column, row, and depth toward the eye."""
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners.tolist()
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if abs(area) < 1e-9:
            return
        height, width, _ = self.pixels.shape
        x0, x1 = max(0, int(min(ax, bx, cx))), min(width, int(max(ax, bx, cx)) + 2)
        y0, y1 = max(0, int(min(ay, by, cy))), min(height, int(max(ay, by, cy)) + 2)
        x, y = np.meshgrid(np.arange(x0, x1) + 0.5, np.arange(y0, y1) + 0.5)
        b = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area
        c = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area
        depth = az + b * (bz - az) + c * (cz - az)
        window = self.pixels[y0:y1, x0:x1]
        front = (b >= 0) & (c >= 0) & (b + c <= 1) & (depth > window[..., 6] + _BEHIND)
        window[front] = [*color, *normal, 0.0, number]
        window[front, 6] = depth[front]

    def picture(self, step: float) -> Pixels:
        """The picture with edges, at its final size, row 0 on top."""
        colors, normals, depth, number = np.split(self.pixels, [3, 6, 7], axis=-1)
        depth, number = depth[..., 0], number[..., 0]
        solid = number >= 0
        edge = np.zeros_like(solid)
        right, above = (np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1, :], np.s_[1:, :])
        for along, (here, there) in enumerate((right, above)):
            both = solid[here] & solid[there]
            normal = normals[here]
            slope = -normal[..., along] / np.maximum(normal[..., 2], 1e-6)  # of the face, from pixel to pixel
            with np.errstate(invalid="ignore"):  # ground behind ground
                apart = np.abs(depth[there] - depth[here] - slope) > step
            bent = (normal * normals[there]).sum(axis=-1) < _SMOOTH
            edge[here] |= (number[here] != number[there]) | (both & (bent | apart))
        color = np.where((edge & solid)[..., None], colors * _EDGE, colors)
        alpha = solid.astype(np.float64)
        height, width = alpha.shape
        blocks = (height // _OVER, _OVER, width // _OVER, _OVER)
        cover = alpha.reshape(blocks).mean(axis=(1, 3))
        mixed = (color * alpha[..., None]).reshape(*blocks, 3).mean(axis=(1, 3)) / np.maximum(cover, 1e-9)[..., None]
        return (np.dstack([mixed, cover])[::-1] * 255 + 0.5).astype(np.uint8)

"""Show which piece goes where: drawn apart, with their numbers."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence

import numpy as np
import trimesh

from core.design import GRIPPER_MOUNTS
from core.geometry import Array
from core.robot.kinematics import open_mounts
from core.values.robots import Robot
from plugins.results.pages.drawing import Painted
from plugins.results.pages.figure import COLORS, new_figure
from plugins.results.workshop.joints import Joint
from plugins.results.workshop.printing import PrintedPart
from plugins.results.workshop.solid import to_mesh

APART = 1.8  # times a joint's reach: how far its pieces are drawn apart
ELEVATION, AZIMUTH = 22.0, -50.0  # of the eye, degrees
FINE_M = 0.012  # the sides of the triangles that are drawn: a painter sorts small ones better
LIGHT = np.array([0.35, -0.5, 0.8]) / np.linalg.norm([0.35, -0.5, 0.8])


def draw_apart(
    parts: Sequence[PrintedPart], joints: Sequence[Joint], robot: Robot
) -> list[Painted]:
    """Return pieces as solids, metres, drawn apart along their joints, as the arm holds them at home.

    Args:
        parts: of the tool, in the order of their numbers.
        joints: between them.
        robot: the arm.
    """
    gripper = any(part.mount in GRIPPER_MOUNTS for part in parts)
    mounts = open_mounts(robot, True) if gripper else {}
    moved = _move_apart(len(parts), joints)
    painted = []
    for number, part in enumerate(parts):
        mesh = to_mesh(part.solid).apply_translation(moved[number])
        mesh.apply_scale(0.001)
        if part.mount in mounts:
            mesh.apply_transform(mounts[part.mount].matrix)

        color = _to_rgb(COLORS[number % len(COLORS)])
        painted.append(Painted(mesh, (*color, 1.0)))

    return painted


def _move_apart(count: int, joints: Sequence[Joint]) -> Array:
    """Return by how much pieces are moved (N, 3), mm: each away from those that it is joined to; the first one stays.

    In a loop not all ways can be kept; then they are as near to it as possible.
    """
    moves = np.zeros((len(joints) + 1, count))
    ways = np.zeros((len(joints) + 1, 3))
    moves[-1, 0] = 1.0
    for row, joint in enumerate(joints):
        below, above = joint.pieces
        moves[row, above - 1] = 1.0
        moves[row, below - 1] = -1.0
        ways[row] = APART * joint.reach_mm * joint.along

    moved, *_ = np.linalg.lstsq(moves, ways, rcond=None)
    return np.asarray(moved)


def _face_eye(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return what faces the eye of a mesh, in small triangles."""
    across = math.cos(math.radians(ELEVATION))
    turn = math.radians(AZIMUTH)
    eye = [
        across * math.cos(turn),
        across * math.sin(turn),
        math.sin(math.radians(ELEVATION)),
    ]
    faces = np.asarray(mesh.faces)[np.asarray(mesh.face_normals) @ eye > 0]
    corners, faces = trimesh.remesh.subdivide_to_size(
        mesh.vertices, faces, FINE_M, max_iter=20
    )
    return trimesh.Trimesh(corners, faces, process=False)


def _to_rgb(color: str) -> tuple[float, float, float]:
    red, green, blue = (int(color[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue


def picture(painted: Sequence[Painted]) -> bytes:
    """Draw pieces with their numbers as a PNG file."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    figure = new_figure(9.0, 7.0)
    axes = figure.add_subplot(projection="3d", computed_zorder=False)
    triangles = []
    colors = []
    for item in painted:
        mesh = _face_eye(item.solid)
        lit = 0.55 + 0.45 * np.clip(np.asarray(mesh.face_normals) @ LIGHT, 0, 1)
        triangles.append(np.asarray(mesh.triangles))
        colors.append(lit[:, None] * np.array(item.color[:3]))

    corners = np.vstack(triangles)
    paint = np.vstack(colors)
    drawn = Poly3DCollection(
        corners, facecolors=paint, edgecolors=paint, linewidths=0.2
    )
    axes.add_collection3d(drawn)
    for number, item in enumerate(painted, 1):
        middle = item.solid.bounds.mean(axis=0)
        axes.text(
            *middle,
            str(number),
            fontsize=13,
            weight="bold",
            zorder=10,
            bbox={"boxstyle": "circle", "facecolor": "white", "linewidth": 0.8},
        )

    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    for axis, (first, last) in zip("xyz", zip(low, high, strict=True), strict=True):
        getattr(axes, f"set_{axis}lim")(first, last)

    axes.set_box_aspect(np.maximum(high - low, 1e-3), zoom=1.15)
    axes.view_init(elev=ELEVATION, azim=AZIMUTH)
    axes.set_axis_off()
    buffer = io.BytesIO()
    figure.savefig(
        buffer,
        format="png",
        dpi=130,
        bbox_inches="tight",
        metadata={"Software": None},
    )
    return buffer.getvalue()

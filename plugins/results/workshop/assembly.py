"""Show which piece goes where: drawn apart, with their numbers."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np

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


def draw_apart(
    parts: Sequence[PrintedPart], joints: Sequence[Joint], robot: Robot
) -> list[Painted]:
    """Return pieces as solids, metres, drawn apart along their joints, as the arm holds them at home.

    Args:
        parts: of the tool, in the order of their numbers.
        joints: between them.
        robot: the arm.
    """
    from matplotlib.colors import to_rgba

    gripper = any(part.mount in GRIPPER_MOUNTS for part in parts)
    mounts = open_mounts(robot, True) if gripper else {}
    moved = _move_apart(len(parts), joints)
    painted = []
    for number, part in enumerate(parts):
        mesh = to_mesh(part.solid).apply_translation(moved[number])
        mesh.apply_scale(0.001)
        if part.mount in mounts:
            mesh.apply_transform(mounts[part.mount].matrix)

        painted.append(Painted(mesh, to_rgba(COLORS[number % len(COLORS)])))

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


def picture(painted: Sequence[Painted]) -> bytes:
    """Draw pieces with their numbers as a PNG file."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    figure = new_figure(9.0, 7.0)
    axes = figure.add_subplot(projection="3d", computed_zorder=False)
    meshes = [item.solid.subdivide_to_size(FINE_M, max_iter=20) for item in painted]
    paint = [
        np.tile(item.color, (len(mesh.faces), 1))
        for item, mesh in zip(painted, meshes, strict=True)
    ]
    corners = np.vstack([mesh.triangles for mesh in meshes])
    colors = np.vstack(paint)
    axes.add_collection3d(
        Poly3DCollection(
            corners, facecolors=colors, edgecolors=colors, linewidths=0.2, shade=True
        )
    )

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
    ends = dict(zip(("xlim", "ylim", "zlim"), np.stack([low, high], 1), strict=True))
    axes.set(**ends)

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

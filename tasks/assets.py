"""Shapes that several tasks use: boards, open boxes, round walls and solids of revolution."""

from __future__ import annotations

from functools import cache

import numpy as np
import trimesh

from core.scene import Box, Color, Cylinder, Geom, Mesh, Pose


def board(
    size: tuple[float, float, float], position: tuple[float, float, float], color: Color
) -> Geom:
    """An upright box with full side lengths, centred at a position in the body's frame."""
    return Geom(Box(size), Pose(np.array(position)), color)


def raised(height: float) -> Pose:
    """A pose so far up z, metres."""
    return Pose(np.array([0.0, 0.0, height]))


def turned(yaw: float) -> Pose:
    """A pose turned about z, radians."""
    return Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, yaw))


def disc(radius: float, height: float, middle: float, color: Color) -> Geom:
    """An upright cylinder around z, whose middle is so far up."""
    return Geom(Cylinder(radius, height), raised(middle), color)


def hull(points: object) -> Mesh:
    """The convex hull of points (P, 3)."""
    return Mesh.from_trimesh(trimesh.convex.convex_hull(np.array(points)))


def open_box(
    length: float, width: float, height: float, wall: float, color: Color
) -> tuple[Geom, ...]:
    """A bottom and four walls, open on top. Lengths are outer ones; the frame is below, in the middle of the bottom."""
    inside = height - wall
    return (
        board((length, width, wall), (0.0, 0.0, wall / 2), color),
        *(
            board(
                (wall, width, inside),
                (side * (length - wall) / 2, 0.0, wall + inside / 2),
                color,
            )
            for side in (-1, 1)
        ),
        *(
            board(
                (length - 2 * wall, wall, inside),
                (0.0, side * (width - wall) / 2, wall + inside / 2),
                color,
            )
            for side in (-1, 1)
        ),
    )


def round_wall(
    inner: tuple[float, float],
    outer: tuple[float, float],
    bottom: float,
    top: float,
    color: Color,
    pieces: int = 24,
) -> tuple[Geom, ...]:
    """Collision shapes of a wall around z: convex wedges. Radii are those at the bottom and at the top.

    The middles of the wedges' flat inner faces are on the inner radius, their outer corners on the outer radius.
    """
    step = 2 * np.pi / pieces
    stretch = 1 / np.cos(step / 2)
    parts = []
    for i in range(pieces):
        angles = np.array([i * step, (i + 1) * step])
        points = [
            (radius * np.cos(angle), radius * np.sin(angle), height)
            for low, high in (
                (inner[0] * stretch, inner[1] * stretch),
                (outer[0], outer[1]),
            )
            for radius, height in ((low, bottom), (high, top))
            for angle in angles
        ]
        parts.append(Geom(hull(points), color=color))
    return tuple(parts)


@cache
def vessel(
    radius: float, height: float, wall: float, floor: float, color: Color
) -> tuple[Geom, ...]:
    """A round bottom and a wall, by its inner radius; the frame is below, in the middle."""
    outer = radius + wall
    bottom = disc(outer, floor, floor / 2, color)
    return bottom, *round_wall(
        (radius, radius), (outer, outer), floor, height, color, 20
    )


@cache
def ringed_post(
    radius: float, hole: float, height: float, bottom: float, color: Color
) -> tuple[Geom, ...]:
    """A post from ``bottom`` up that ends in a ring, 4 mm high, with a ``hole`` (its radius) on which a ball stays."""
    ring = 0.004
    top = bottom + height
    post = disc(radius, height - ring, (bottom + top - ring) / 2, color)
    return post, *round_wall((hole, hole), (radius, radius), top - ring, top, color, 8)


def revolved(
    profile: list[tuple[float, float]], color: Color, sections: int = 64
) -> Geom:
    """A visual solid of revolution around z. Its closed outline is (radius, height) pairs, counter-clockwise."""
    mesh = trimesh.creation.revolve(np.array([*profile, profile[0]]), sections=sections)
    return Geom(Mesh.from_trimesh(mesh), color=color)

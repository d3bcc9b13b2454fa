"""Shapes that tests share: a prism, and a bowl that is hollow."""

import math

import numpy as np
import trimesh

from core.geometry import KINDS, Compound, Mesh


def sample(kind):
    """A shape of a kind, of a few centimetres: its numbers go down."""
    count = sum(kind.lengths().values())
    return kind.of(*(round(0.03 * 0.6**number, 4) for number in range(count)))


SAMPLES = tuple(map(sample, KINDS))
"""One of each kind that designs and scene files name."""


def prism(sides, radius, length):
    """A prism along z of so many sides."""
    return Mesh.from_trimesh(
        trimesh.creation.cylinder(radius=radius, height=length, sections=sides)
    )


def bowl(radius, wall, rings=3, sides=16):
    """Half of a spherical shell, open at the top; its frame is at the sphere's centre."""
    polar = np.linspace(0.0, math.pi / 2, rings + 1)
    arc = np.column_stack([np.sin(polar), -np.cos(polar)])
    step = 2 * math.pi / sides
    parts = []
    for ring, side in np.ndindex(rings, sides):
        edge = arc[ring : ring + 2]
        wedge = [
            _turn(edge * size, (side + end) * step)
            for size in (radius, radius + wall)
            for end in (0, 1)
        ]
        parts.append(
            Mesh.from_trimesh(trimesh.PointCloud(np.concatenate(wedge)).convex_hull)
        )
    outline = np.concatenate([arc * (radius + wall), arc[::-1] * radius])
    return Compound(
        Mesh.from_trimesh(trimesh.creation.revolve(outline, sections=sides)),
        tuple(parts),
    )


def within(mesh, points):
    """Tell which points (P,) are inside a closed mesh, from the solid angles of its triangles."""
    a, b, c = (mesh.triangles[None, :, k] - points[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))
    high = np.einsum("ptx,ptx->pt", a, np.cross(b, c))
    low = la * lb * lc + (a * b).sum(2) * lc + (b * c).sum(2) * la + (c * a).sum(2) * lb
    return np.arctan2(high, low).sum(axis=1) > math.pi


def _turn(line, angle):
    """Turn a line (N, 2) of the xz plane about z: (N, 3)."""
    across, up = line.T
    return np.column_stack([across * math.cos(angle), across * math.sin(angle), up])

"""Find the convex solids that a mesh was cut into by others: its groups, and the closed shells in each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import trimesh
from scipy.spatial import ConvexHull, QhullError

from core.geometry import Array

MAX_PIECES = 512
_CONVEX = 0.98  # of its hull's volume


def find_pieces(
    groups: Sequence[trimesh.Trimesh],
) -> tuple[list[Array], trimesh.Trimesh | None, float]:
    """Find the convex pieces of a mesh, of which a file has one or more groups.

    Pieces may touch, and share corners, edges and faces.

    Returns:
        the corners (V, 3) of each closed convex shell; all that is not convex or not closed, or None; and the volume,
        nan where the mesh is not closed.

    Raises:
        QhullError: it is flat.
    """
    whole = _join(groups)
    ConvexHull(whole.vertices)
    shells = [shell for group in groups for shell in _split(group)]
    if not all(shell.is_watertight for shell in shells):
        # Groups may be parts of one surface, such as those of one material.
        shells = list(_split(whole))
    if not shells:
        raise QhullError

    volume = math.nan
    if all(shell.is_watertight for shell in shells):
        volume = sum(abs(shell.volume) for shell in shells)

    convex = [shell.vertices for shell in shells if _is_convex(shell)]
    if len(convex) > MAX_PIECES:
        return [], whole, volume

    rest = [shell for shell in shells if not _is_convex(shell)]
    if not rest:
        return convex, None, volume

    return convex, _join(rest), volume


def _is_convex(shell: trimesh.Trimesh) -> bool:
    """Check if a mesh is closed and nearly fills its convex hull."""
    if not (shell.is_watertight and shell.volume):
        return False

    return bool(abs(shell.volume) > _CONVEX * ConvexHull(shell.vertices).volume)


def _join(meshes: Sequence[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Make one mesh of several, in which equal corners are one."""
    vertices = [mesh.vertices for mesh in meshes]
    faces = [mesh.faces for mesh in meshes]
    whole = trimesh.Trimesh(*trimesh.util.append_faces(vertices, faces))
    whole.remove_unreferenced_vertices()
    return whole


def _split(mesh: trimesh.Trimesh) -> Iterator[trimesh.Trimesh]:
    """Yield the shells of a mesh.

    They stand one after the other in files, so that a shell is complete where each edge was met an even number of
    times, even if shells share edges. What is not found so is split by its neighbours.
    """
    plain = trimesh.Trimesh(mesh.vertices, mesh.faces)
    corners = np.sort(plain.faces, axis=1)
    plain.update_faces((np.diff(corners, axis=1) > 0).all(axis=1))
    unmatched = set[tuple[int, int]]()
    first = 0
    edges = plain.edges_sorted.reshape(-1, 3, 2)
    for number, sides in enumerate(edges.tolist(), 1):
        unmatched ^= {(start, stop) for start, stop in sides}
        if not unmatched or number == len(edges):
            shell = plain.submesh([range(first, number)], append=True)
            first = number
            if not shell.is_winding_consistent:
                shell.fix_normals()
            if _is_convex(shell):
                yield shell
            else:
                yield from shell.split(only_watertight=False, repair=False)

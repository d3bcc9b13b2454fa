"""Measure how far bodies reach toward a camera, in each pixel of its picture."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from core.geometry import Array, Pose
from core.scene import Body, Camera
from core.simulation.projection import project

if TYPE_CHECKING:
    import trimesh

_CLEAR = 0.9
"""An opacity, 0..1; a depth camera does not measure what has less: glass has no depth."""


def nearness(
    bodies: Iterable[Body],
    camera: Camera,
    wide: int,
    high: int,
    clear: float = _CLEAR,
) -> Array:
    """Compute how far bodies reach toward a camera in each pixel (high, wide), metres from the origin.

    It is a depth map without a renderer, and so the same on every machine.

    From above that is the height. Where nothing is, it is nan; what is clear, as glass, is left out.

    Args:
        bodies: where they are in the layout.
        camera: between the corners of a triangle, exact for a parallel one alone.
        wide: pixels.
        high: pixels.
        clear: what has a lower opacity is left out.
    Returns:
        Rows from the top of the picture.
    """
    nearest = np.full((high, wide), -np.inf)
    for body in bodies:
        for part in body.visuals:
            if part.color[3] >= clear:
                mesh = part.shape.to_trimesh()
                _raise_to_mesh(nearest, mesh, body.pose @ part.pose, camera)

    return np.where(np.isfinite(nearest), nearest, np.nan)


def _raise_to_mesh(
    nearest: Array,
    mesh: trimesh.Trimesh,
    pose: Pose,
    camera: Camera,
) -> None:
    """Raise ``nearest`` (H, W) to the triangles of a mesh.

    Of a closed mesh those that face the camera are enough, which are half of them.

    Args:
        nearest: is changed.
        mesh: of a shape.
        pose: of the mesh in the world.
        camera: a parallel one.
    """
    # Pixels are counted from their middles.
    high, wide = nearest.shape
    points = pose.apply(np.asarray(mesh.vertices, dtype=np.float64))
    pixels = project(camera, points, wide, high) - 0.5
    toward = -points @ camera.axes[2]

    faces = np.asarray(mesh.faces)

    if mesh.is_volume:  # what faces away is hidden by the rest
        backward = pose.rotation.inv().apply(camera.axes[2])
        faces = faces[np.asarray(mesh.face_normals) @ backward < 0]

    for corners in faces:
        _raise_to_triangle(nearest, pixels[corners], toward[corners])


def _raise_to_triangle(
    nearest: Array,
    corners: Array,
    toward: Array,
) -> None:
    """Raise ``nearest`` (H, W) to a triangle.

    A pixel belongs to the triangle if its middle is inside. What is nearer there already stays.

    Args:
        nearest: is changed.
        corners: in pixels, (3, 2).
        toward: how far each corner reaches toward the camera, (3,), metres.
    """
    edges = (corners[1:] - corners[0]).T
    if abs(np.linalg.det(edges)) < 1e-9:  # it is seen edge on
        return

    # The pixels that the triangle may cover, cut off at the picture's edges.
    size = nearest.shape[::-1]
    left, top = np.clip(np.ceil(corners.min(axis=0)), 0, size).astype(int)
    right, bottom = np.clip(np.floor(corners.max(axis=0)) + 1, 0, size).astype(int)
    pixels = np.meshgrid(np.arange(left, right), np.arange(top, bottom))

    # The shares of both edges in the way from the first corner to each pixel.
    ways = np.stack(pixels, axis=-1) - corners[0]
    shares = ways @ np.linalg.inv(edges).T
    inside = (shares >= -1e-9).all(axis=-1) & (shares.sum(axis=-1) <= 1 + 1e-9)

    # Between the corners it is flat.
    values = toward[0] + shares @ (toward[1:] - toward[0])
    part = nearest[top:bottom, left:right]
    np.maximum(part, np.where(inside, values, -np.inf), out=part)

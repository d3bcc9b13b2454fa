"""Measure how far bodies reach toward a parallel camera, in each pixel of its picture."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from core.geometry import Array
from core.scene import Body, Camera

_CLEAR = (
    0.9  # opacity; a depth camera does not measure what has less: glass has no depth
)


def nearness(bodies: Iterable[Body], camera: Camera, wide: int, high: int) -> Array:
    """Compute how far bodies reach toward a parallel camera in each pixel (high, wide), metres from the origin.

    From above that is the height. Where nothing is, it is nan; what is clear, as glass, is left out.
    """
    found = np.full((high, wide), -np.inf)
    for body in bodies:
        for part in body.visuals:
            if part.color[3] <= _CLEAR:
                continue
            mesh = part.shape.to_trimesh()
            pose = body.pose @ part.pose
            points = pose.apply(np.asarray(mesh.vertices, dtype=np.float64))
            pixels = camera.project(points, wide, high) - 0.5
            toward = -points @ camera.axes[2]
            faces = np.asarray(mesh.faces)
            if mesh.is_volume:  # what faces away is hidden by the rest
                backward = pose.rotation.inv().apply(camera.axes[2])
                faces = faces[np.asarray(mesh.face_normals) @ backward < 0]
            for corners in faces:
                _raise(found, pixels[corners], toward[corners])
    return np.where(np.isfinite(found), found, np.nan)


def _raise(found: Array, corners: Array, z: Array) -> None:
    """Raise ``found`` (H, W) to a triangle of corners (3, 2) in pixels, with the values ``z`` (3,)."""
    x0, y0 = np.ceil(corners.min(axis=0))
    x1, y1 = np.floor(corners.max(axis=0))
    columns = np.arange(max(int(x0), 0), min(int(x1), found.shape[1] - 1) + 1)
    rows = np.arange(max(int(y0), 0), min(int(y1), found.shape[0] - 1) + 1)
    edges = np.stack([corners[1] - corners[0], corners[2] - corners[0]], axis=1)
    if not len(columns) or not len(rows) or abs(np.linalg.det(edges)) < 1e-9:
        return
    away = np.stack(np.meshgrid(columns, rows), axis=-1) - corners[0]
    shares = away @ np.linalg.inv(edges).T
    inside = (shares >= -1e-9).all(axis=-1) & (shares.sum(axis=-1) <= 1 + 1e-9)
    part = found[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    values = np.where(inside, z[0] + shares @ (z[1:] - z[0]), -np.inf)
    np.maximum(part, values, out=part)

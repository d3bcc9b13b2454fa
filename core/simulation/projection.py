"""Project places into pictures."""

from __future__ import annotations

import numpy as np

from core.geometry import Array
from core.scene import Camera


def project(
    camera: Camera,
    points: Array,
    width: int,
    height: int,
) -> Array:
    """Project points (..., 3) into a picture: pixels (..., 2) from its left and its top edge.

    Args:
        camera: with a perspective, or a parallel one.
        points: in the world, metres.
        width: of the picture, pixels.
        height: of the picture, pixels.
    """
    seen = (points - np.asarray(camera.position)) @ camera.axes.T
    if camera.height_m is None:
        scale = height / 2 / np.tan(np.radians(camera.fov_deg) / 2) / seen[..., 2:]
    else:
        scale = np.asarray(height / camera.height_m)

    middle = np.array([width / 2, height / 2])
    pixels: Array = middle + scale * seen[..., :2] * [1.0, -1.0]

    return pixels

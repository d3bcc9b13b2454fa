"""Cameras of photographs: where a point of the world lies in one, and where a camera stood that sees known places."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from core.errors import UserError
from core.geometry import Array
from core.scene import Camera

LEAST_PLACES = 4
MOST_OFF_PX = 25.0  # beyond it, places and pixels don't belong together
_NEAR_M = 0.05


@dataclass(frozen=True)
class View:
    """A photograph's camera, which may be rolled about its axis, by ``roll`` rad; and the photograph's size, pixels."""

    camera: Camera
    size: tuple[int, int]
    roll: float = 0.0

    @property
    def focal(self) -> float:
        """The focal length, pixels."""
        return self.size[1] / 2 / math.tan(math.radians(self.camera.fov_deg) / 2)

    def project(self, points: Array) -> Array:
        """Compute the pixels (N, 2) of points (N, 3) of the world; what is behind the camera is far outside."""
        right, up, forward = self.camera.axes
        away = points - np.array(self.camera.position)
        depth = np.maximum(away @ forward, _NEAR_M)
        turned = (away @ right + 1j * (away @ up)) * np.exp(-1j * self.roll)
        scaled = self.focal * turned / depth
        shift = np.stack([scaled.real, -scaled.imag], axis=-1)
        pixels: Array = np.array(self.size) / 2 + shift
        return pixels


def load_opencv() -> Any:
    """Load OpenCV.

    Raises:
        UserError: it is not installed.
    """
    try:
        import cv2
    except ModuleNotFoundError as error:
        raise UserError(
            "finding a camera needs OpenCV: pip install 'opencv-python-headless>=4.8'; or measure where it stood, and "
            "give cameras=[{position: [x,y,z], target: [x,y,z], fov_deg: 52}]"
        ) from error

    return cv2


def find_view(
    places: Array, pixels: Array, size: tuple[int, int], fov_deg: float
) -> View:
    """Find the camera that sees places (N, 3) at pixels (N, 2), with OpenCV.

    Raises:
        UserError: OpenCV is not installed, or no camera sees them so.
    """
    cv2 = load_opencv()
    width, height = size
    focal = height / 2 / math.tan(math.radians(fov_deg) / 2)
    lens = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    _, turn, shift = cv2.solvePnP(places, pixels, lens, None, flags=cv2.SOLVEPNP_SQPNP)
    rotation = cv2.Rodrigues(turn)[0]
    position = -rotation.T @ shift.ravel()
    far = np.linalg.norm(places.mean(axis=0) - position)
    target = position + far * rotation[2]
    camera = Camera(tuple(position.tolist()), tuple(target.tolist()), fov_deg)
    right, up, _ = camera.axes
    view = View(camera, size, math.atan2(rotation[0] @ up, rotation[0] @ right))
    off = np.linalg.norm(view.project(places) - pixels, axis=1).max()
    if off > MOST_OFF_PX:
        raise UserError(
            f"no camera sees the known places where they are in the photograph: at best they are off by {off:.0f} "
            "pixels; check them, and fov_deg"
        )

    return view

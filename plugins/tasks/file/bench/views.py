"""Cameras of photographs: where a point of the world lies in one, and where a camera stood that sees known places."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.spatial.transform import Rotation

from core.errors import UserError
from core.geometry import Array
from core.scene import Camera

LEAST_PLACES = 4
MOST_OFF_PX = 25.0  # beyond it, places and pixels don't belong together
_NEAR_M = 0.05
_EDGE = 1.2  # times as far from the middle as a corner: beyond it, a lens bends no more


@dataclass(frozen=True)
class View:
    """A photograph's camera, and what a scene file can't say of it.

    Attributes:
        camera: where it stood.
        size: the photograph's width and height, pixels.
        roll: by which it is rolled about its axis, rad.
        bend: of its lens: the first radial coefficient of OpenCV's model, in squares of tangents.
    """

    camera: Camera
    size: tuple[int, int]
    roll: float = 0.0
    bend: float = 0.0

    @property
    def focal(self) -> float:
        """The focal length, pixels."""
        return self.size[1] / 2 / math.tan(math.radians(self.camera.fov_deg) / 2)

    @cached_property
    def axes(self) -> Array:
        """The directions to the right, up and forward in the photograph, as rows (3, 3)."""
        right, up, forward = self.camera.axes
        cos = math.cos(self.roll)
        sin = math.sin(self.roll)
        return np.stack([cos * right + sin * up, cos * up - sin * right, forward])

    def project(self, points: Array) -> Array:
        """Compute the pixels (N, 2) of points (N, 3) of the world; what is behind the camera is far outside."""
        away = (points - np.array(self.camera.position)) @ self.axes.T
        depth = np.maximum(away[:, 2:], _NEAR_M)
        tangents = away[:, :2] / depth
        half = np.array(self.size) / 2
        most = (_EDGE * np.linalg.norm(half) / self.focal) ** 2
        squares = np.sum(tangents**2, axis=1, keepdims=True).clip(max=most)
        bent = tangents * (1 + self.bend * squares)
        pixels: Array = half + self.focal * bent * [1, -1]
        return pixels

    def shift(self, metres: Array, turn: Array, fov_deg: float, bend: float) -> View:
        """Return the view of a camera that stands elsewhere.

        Args:
            metres: (3,) along the world's axes.
            turn: (3,) rad, a rotation vector about the photograph's right, up and forward.
            fov_deg: by how much its vertical field of view is larger.
            bend: by how much its lens bends more.
        """
        rotation = Rotation.from_rotvec(turn).as_matrix() @ self.axes
        position = np.array(self.camera.position) + metres
        far = float(np.linalg.norm(np.subtract(self.camera.target, position)))
        fov = self.camera.fov_deg + fov_deg
        return look(position, rotation, far, fov, self.size, self.bend + bend)


class CameraError(BaseModel):
    """How far a camera may be from what was measured of it, one standard deviation along each axis.

    Attributes:
        place_m: of its place.
        turn_deg: of its direction, and of its roll.
        fov_deg: of its vertical field of view.
        bend: of its lens, a radial coefficient (`View`): one that bends by 2 % in the corners of a photograph.
        board_m: of the middle of the printed board.
        board_deg: of the board's yaw.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)

    place_m: Annotated[float, Field(gt=0, le=1)] = 0.01
    turn_deg: Annotated[float, Field(gt=0, le=45)] = 1.0
    fov_deg: Annotated[float, Field(gt=0, le=30)] = 1.0
    bend: Annotated[float, Field(gt=0, le=1)] = 0.03
    board_m: Annotated[float, Field(gt=0, le=1)] = 0.003
    board_deg: Annotated[float, Field(gt=0, le=45)] = 0.5

    @property
    def board(self) -> Array:
        """Of the board's x, y and yaw: (3,), m and degrees."""
        return np.array([self.board_m, self.board_m, self.board_deg])


@dataclass(frozen=True)
class Landmarks:
    """Points whose places are known, and where they are in a photograph.

    Attributes:
        places: (N, 3) in the world.
        pixels: (N, 2).
        error_px: of a pixel, one standard deviation.
        markers: of the printed board, whose place was measured; 0: these are places of their own.
    """

    places: Array
    pixels: Array
    error_px: float
    markers: int = 0


def look(
    position: Array,
    axes: Array,
    far: float,
    fov_deg: float,
    size: tuple[int, int],
    bend: float = 0.0,
) -> View:
    """Build a view from a position (3,), with right, up and forward as rows (3, 3); its target is ``far`` ahead, m."""
    target = position + far * axes[2]
    camera = Camera(tuple(position.tolist()), tuple(target.tolist()), fov_deg)
    right, up, _ = camera.axes
    return View(camera, size, math.atan2(axes[0] @ up, axes[0] @ right), bend)


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
    far = float(np.linalg.norm(places.mean(axis=0) - position))
    # OpenCV's axes are right, down and forward.
    axes = rotation * np.array([[1], [-1], [1]])
    view = look(position, axes, far, fov_deg, size)
    off = np.linalg.norm(view.project(places) - pixels, axis=1).max()
    if off > MOST_OFF_PX:
        raise UserError(
            f"no camera sees the known places where they are in the photograph: at best they are off by {off:.0f} "
            "pixels; check them, and fov_deg"
        )

    return view

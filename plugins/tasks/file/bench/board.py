"""A board of markers, printed and laid on the table, by which the cameras of photographs are found."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from core.errors import UsageError, UserError
from core.geometry import Array, Pose
from core.simulation.pictures import describe_camera
from core.support.cli import expand, say, write_bytes
from plugins.tasks.file.bench.photographs import Photograph
from plugins.tasks.file.bench.views import Landmarks, load_opencv
from plugins.tasks.file.photos import write_caption

COUNTS = (3, 4)  # markers across and along the sheet
MARKER_M = 0.05
GAP_M = 0.012
SHEET_M = np.array([0.21, 0.297])  # A4
_EXTENT_M: Array = np.array(COUNTS) * (MARKER_M + GAP_M) - GAP_M  # of all markers
_DOTS_PER_M = 300 / 0.0254
CORNER_PX = 1.0  # how well a marker's corner is found, with the print's errors
FAR_M = 5.0  # no board lies farther from the robot: the number is of another unit
_LEAST_MARKERS = 2
_MANY_MARKERS = 4  # in a mirror image: so many are no chance
_SHARPEN_PX = 2.0
_WORDS = f"up: forward from the robot, at yaw 0   -   print at 100 %: each marker is {1000 * MARKER_M:.0f} mm wide"

_YAW = "at yaw 0 its edge with the words is away from the robot (toward x), at yaw 90 to the left (toward y)"


def print_board(name: str) -> None:
    """Write the sheet, PDF or PNG in its true size.

    Raises:
        UserError: OpenCV is not installed, or the file can't be written.
    """
    file = expand(name)
    kind = file.suffix[1:].upper()
    if kind not in ("PDF", "PNG"):
        raise UsageError(f"the board is a PDF or PNG file, not {name}; say board.pdf")

    cv2 = load_opencv()
    board = _board()
    size = np.rint(SHEET_M * _DOTS_PER_M).astype(int)
    sheet = Image.new("L", tuple(size.tolist()), 255)
    side = round(MARKER_M * _DOTS_PER_M)
    margin = (SHEET_M - _EXTENT_M) / 2
    for number, corners in enumerate(board.getObjPoints()):
        marker = cv2.aruco.generateImageMarker(board.getDictionary(), number, side)
        left, top = np.rint((corners[0, :2] + margin) * _DOTS_PER_M).astype(int)
        sheet.paste(Image.fromarray(marker), (left, top))

    ImageDraw.Draw(sheet).text((200, 180), _WORDS, font_size=40)
    stream = io.BytesIO()
    sheet.save(stream, kind, resolution=300, dpi=(300, 300))
    write_bytes(file, stream.getvalue())
    say(
        f"{name} is written: print it at 100 %, lay it flat on the table where all photographs show it, measure where "
        f"its middle lies, and give board=[x,y,yaw_deg]; {_YAW}"
    )


def find_by_board(
    photographs: Sequence[Photograph],
    place: Sequence[float],
    fov_deg: float | None = None,
    marker_mm: float = 1000 * MARKER_M,
) -> list[Photograph]:
    """Find the cameras of photographs by the board, whose middle is at x, y and turned by yaw, m and degrees.

    What has a view keeps it; where no board is seen, a line says so. A marker is ``marker_mm`` wide as it was printed.

    Raises:
        UserError: OpenCV is not installed, the place is none, or no camera sees the board so.
    """
    if len(place) != 3:
        raise UsageError(
            f"the board's place is x, y and yaw, such as board=[0.4,-0.3,0]; m and degrees; {_YAW}"
        )

    x, y, yaw_deg = place
    if max(abs(x), abs(y)) > FAR_M:
        unit = 100 if max(abs(x), abs(y)) < FAR_M * 100 else 1000
        raise UsageError(
            f"the board's place is in metres and degrees; type board=[{x / unit:g},{y / unit:g},{yaw_deg:g}] if "
            f"board=[{x:g},{y:g},{yaw_deg:g}] was {'centimetres' if unit == 100 else 'millimetres'}"
        )
    if not 0 < marker_mm < 1000:
        raise UsageError(f"board_marker_mm={marker_mm:g} is no width of a marker, mm")

    say(f"board: middle at ({x:g}, {y:g}), yaw {yaw_deg:g} degrees; {_YAW}")
    frame = find_frame(place)
    scale = marker_mm / (1000 * MARKER_M)

    def find(photograph: Photograph, pixels: Array) -> Photograph | None:
        landmarks = _find_markers(pixels, frame, scale)
        return None if landmarks is None else photograph.find(landmarks, fov_deg)

    found = list[Photograph]()
    for photograph in photographs:
        name = photograph.picture.name
        pixels = np.asarray(Image.open(io.BytesIO(photograph.picture.png)).convert("L"))
        try:
            by_board = find(photograph, pixels) or find(photograph, _sharpen(pixels))
        except UserError:
            _refuse_mirrored(pixels, frame, scale, photograph)
            raise

        if by_board is None:
            _refuse_mirrored(pixels, frame, scale, photograph)
            say(
                f"{name}: the board is not found in it (fewer than {_LEAST_MARKERS} markers); lay it flat where "
                "nothing hides it, go nearer, hold still, and avoid glare"
            )
            found.append(photograph)
        elif photograph.view is None:
            found.append(_describe(by_board))
        else:
            found.append(replace(photograph, landmarks=by_board.landmarks))

    return found


def _refuse_mirrored(
    pixels: Array, frame: Pose, scale: float, photograph: Photograph
) -> None:
    """Refuse a photograph in whose mirror image the board is found.

    Raises:
        UsageError: it is one.
    """
    landmarks = _find_markers(np.ascontiguousarray(pixels[:, ::-1]), frame, scale)
    if landmarks is not None and landmarks.markers >= _MANY_MARKERS:
        raise UsageError(
            f"{photograph.picture.name} is mirrored, as the board in it shows: give the picture as it was taken"
        )


def _sharpen(pixels: Array) -> Array:
    """Return a picture (H, W) that was sharpened: markers are found in it that blur hid."""
    cv2 = load_opencv()
    blurred = cv2.GaussianBlur(pixels, (0, 0), _SHARPEN_PX)
    sharp: Array = cv2.addWeighted(pixels, 5.0, blurred, -4.0, 0)
    return sharp


def _find_markers(pixels: Array, frame: Pose, scale: float) -> Landmarks | None:
    """Find the board's markers in a grey picture (H, W); None: fewer than are needed."""
    cv2 = load_opencv()
    board = _board()
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(board.getDictionary(), settings)
    corners, names, _ = detector.detectMarkers(pixels)
    if len(corners) < _LEAST_MARKERS:
        return None

    points, seen = board.matchImagePoints(corners, names)
    # On the sheet x is to the right and y down, from the first marker's corner.
    right, down = (points.reshape(-1, 3)[:, :2] - _EXTENT_M / 2).T
    world = frame.apply(scale * np.stack([-down, -right, 0 * right], axis=1))
    # OpenCV counts from the middle of the first pixel.
    middles = seen.reshape(-1, 2) + 0.5
    return Landmarks(world, middles, CORNER_PX, len(corners))


def find_frame(place: Sequence[float]) -> Pose:
    """Return the pose of a board that lies at x, y, turned by yaw, m and degrees."""
    x, y, yaw_deg = place
    return Pose.xyz_rpy((x, y, 0.0), (0.0, 0.0, np.radians(yaw_deg)))


def _describe(photograph: Photograph) -> Photograph:
    """Say in a photograph's caption where the board tells that it was taken."""
    view = photograph.view
    assert view is not None
    where = f"{describe_camera(view.camera, view.size)} (by the printed board in it)"
    return replace(photograph, picture=write_caption(photograph.picture, where))


def _board() -> Any:
    aruco = load_opencv().aruco
    markers = aruco.getPredefinedDictionary(aruco.DICT_4X4_50)
    return aruco.GridBoard(COUNTS, MARKER_M, GAP_M, markers)

"""Draw a scene for a designer that is told no number: calibrated pictures."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from PIL import Image as Pillow
from PIL import ImageDraw
from scipy.ndimage import binary_erosion, gaussian_filter, maximum_filter

from core.geometry import Array, Pose
from core.interfaces import Image, Picture, Task
from core.scene import Body, Camera
from core.simulation.pictures import describe_camera, png
from core.simulation.projection import project
from plugins.vlms.context.bodies_table import bounds, bounds_in_world
from plugins.vlms.context.nearness import nearness

WIDTH = 1000  # pixels
HEIGHT = 750
SIZE = (WIDTH, HEIGHT)
_ROOM_M = 0.06  # around what a parallel camera shows; it stands half of that before it, and cuts off what is behind it
_LARGE_M = 1.2  # what is larger, as table and floor, does not set what is shown
_ROUND_M = 0.05  # of what a camera looks at: its caption must not tell where a body is
_AXIS_M = 0.04  # length of a drawn axis
_ALL = 14  # of so many bodies alike each has a label, of more the first and the last
_STEPS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)  # metres, between lines
_LINES = 18  # along a side, at most
_MARGIN = 46  # pixels of a scale
_OPAQUE = 150  # of 255: the opacity of drawn edges
_DARK = 100  # of 255: a brightness; on what is darker, edges are pale
_EDGE_M = 0.002  # a bend or a step that is drawn as an edge
_FONT = 12  # pixels
_HIGH = 16  # pixels of a name
_AROUND = 14.0  # pixels that count as around
_DEEP_M = 0.008  # so much deeper than what is around it is as dark as it gets
_SHADE = 0.6  # of the light that is lost there
_GAMMA = 0.75  # below 1: brighter

_INK = (20, 20, 20)
_PALE = (255, 255, 255)
_RED = (210, 30, 30)
_GREEN = (20, 150, 40)


@dataclass(frozen=True)
class _View:
    """A direction from which a parallel camera looks.

    Attributes:
        backward: from the scene to the camera, a unit vector (3,).
        right: the number of the world's axis to the right in the picture.
        up: the number of the world's axis up in the picture.
    """

    backward: tuple[float, float, float]
    right: int
    up: int


_PARALLEL = {
    "front": _View((-1.0, 0.0, 0.0), 1, 2),
    "side": _View((0.0, -1.0, 0.0), 0, 2),
    "top": _View((0.0, 0.0, 1.0), 0, 1),
}


VIEWS = ("scene", "close", "robot", *_PARALLEL)
"""The pictures, in the order in which a prompt shows them."""


def calibrated_pictures(
    task: Task,
    seed: int,
    render: Callable[..., Image],
    only: str | Camera = "",
    cut: float | None = None,
) -> tuple[Picture, ...]:
    """Draw the scene at the start: from the task's camera, closer, from the robot's side, and in parallel views.

    For ``render`` see `core.task.Level.draw`.

    Args:
        task: whose scene and camera it is about.
        seed: of the layout.
        render: draws the scene from a camera, without what is written on it.
        only: the one that is wanted, or another camera, whose picture is named ``look``; empty: all.
        cut: where the parallel views cut the scene, metres along their axis; None: before all of it.

    Returns:
        In the order of `VIEWS`, each with its caption.

    Raises:
        NoPicture: nothing here can draw.
    """
    bodies = task.scene(seed).bodies
    small = _find_small(bodies)

    low, high = bounds_in_world([body for body in bodies if body.mass] or bodies)
    cameras = {
        "scene": task.camera,
        "close": move_closer(task.camera, low, high),
        "robot": move_closer(_look_from_robot(task.camera), low, high),
        **{name: parallel_camera(name, bodies, cut) for name in _PARALLEL},
    }
    if isinstance(only, Camera):
        cameras = {"look": only}
    elif only:
        cameras = {only: cameras[only]}

    pictures = []
    for name, camera in cameras.items():
        picture = Pillow.fromarray(render(camera=camera, width=WIDTH, height=HEIGHT))
        # Also where they are clear.
        covered = [
            ~np.isnan(nearness([body], camera, WIDTH, HEIGHT, clear=0.0))
            for body in small
        ]
        if name in _PARALLEL:
            picture = _light(picture, nearness(small, camera, WIDTH, HEIGHT))
            _draw_edges(picture, camera, small, covered)
            caption = _draw_grid(picture, camera, _PARALLEL[name])
        else:
            caption = describe_camera(camera, SIZE)

        _Labels(picture, camera, covered).draw(small)
        pictures.append(Picture(png(np.asarray(picture)), name, f"{name}: {caption}"))

    return tuple(pictures)


def _find_small(bodies: Sequence[Body]) -> list[Body]:
    """Find the bodies that are smaller than a table.

    It is their own size that counts, along their own axes.

    Args:
        bodies: of a layout.
    """
    return [
        body for body in bodies if np.ptp(bounds(body, Pose()), axis=0).max() < _LARGE_M
    ]


def parallel_camera(
    name: str, bodies: Sequence[Body], cut: float | None = None
) -> Camera:
    """Make the camera of a parallel view, which shows all bodies but what is as large as a table.

    Args:
        name: ``front``, ``side`` or ``top``.
        bodies: of the layout.
        cut: where the camera stands along its axis, metres: it does not show what is behind it. None: before all.
    """
    view = _PARALLEL[name]
    low, high = bounds_in_world(_find_small(bodies) or bodies)
    backward = np.array(view.backward)

    room = high - low + 2 * _ROOM_M
    tall = room[view.up] * HEIGHT / (HEIGHT - 2 * _MARGIN)
    wide = room[view.right] * HEIGHT / (WIDTH - 2 * _MARGIN)

    middle = (low + high) / 2
    away = float(np.abs(backward @ (high - low))) / 2 + _ROOM_M / 2
    stand = middle + away * backward
    if cut is not None:
        axis = int(np.abs(backward).argmax())
        stand[axis] = cut
        middle[axis] = cut - _ROUND_M * backward[axis]
    place = tuple(stand.tolist())

    return Camera(place, tuple(middle.tolist()), 2.0, float(max(tall, wide)))


def move_closer(camera: Camera, low: Array, high: Array) -> Camera:
    """Look from the same place at a part of the world alone.

    Args:
        camera: which keeps its place.
        low: the lowest corner (3,) of what fills the picture.
        high: its highest corner (3,).
    """
    middle = _ROUND_M * np.round((low + high) / 2 / _ROUND_M)
    away = float(np.linalg.norm(np.asarray(camera.position) - middle))

    half = max(float(np.linalg.norm(high - low)) / 2, 0.08) + _ROUND_M / 2
    fov_deg = float(np.degrees(2 * np.arctan(half / away))) * 1.15

    return replace(camera, target=tuple(middle.tolist()), fov_deg=fov_deg)


def _look_from_robot(camera: Camera) -> Camera:
    """Look from the robot's side, on which tools work; from its other hand if the camera is there already."""
    x, y, z = camera.position
    if x > camera.target[0]:
        return replace(camera, position=(2 * camera.target[0] - x, y, z))

    return replace(camera, position=(x, 2 * camera.target[1] - y, z))


def _light(picture: Pillow.Image, near: Array) -> Pillow.Image:
    """Brighten a parallel view, and darken what lies deeper than what is around it, such as a slot in a face.

    Args:
        picture: as it was drawn.
        near: how far bodies reach toward the camera, (H, W) metres; nan: nothing does.
    """
    known = ~np.isnan(near)
    weights = gaussian_filter(known.astype(float), _AROUND)
    around = gaussian_filter(np.where(known, near, 0.0), _AROUND)
    around = around / np.maximum(weights, 1e-6)

    deep = np.where(known, np.clip((around - near) / _DEEP_M, 0.0, 1.0), 0.0)
    bright = (np.asarray(picture) / _PALE[0]) ** _GAMMA
    lit = bright * (1.0 - _SHADE * deep)[..., None]

    return Pillow.fromarray((_PALE[0] * lit).astype(np.uint8))


def _draw_grid(picture: Pillow.Image, camera: Camera, view: _View) -> str:
    """Draw lines and scales in metres over a parallel view, so that positions can be read off.

    Args:
        picture: that is drawn on.
        camera: a parallel one, which took the picture.
        view: the camera's direction.

    Returns:
        A part of the picture's caption: what one needs to measure in the picture.
    """
    assert camera.height_m is not None
    pen = ImageDraw.Draw(picture, "RGBA")
    per_m = HEIGHT / camera.height_m

    # The closest distance of lines of which there are not too many.
    enough = [step for step in _STEPS if WIDTH / per_m / step <= _LINES]
    step = min(enough, default=_STEPS[-1])
    right = view.right
    up = view.up
    sign = float(np.sign(camera.axes[0][right]))

    for position, x in _list_lines(camera.target[right], WIDTH, per_m, step, sign):
        pen.line([(x, 0), (x, HEIGHT)], fill=(*_INK, 100))
        _write(pen, (x + 2, HEIGHT - 15), f"{position:.2f}")

    for position, y in _list_lines(camera.target[up], HEIGHT, per_m, step, -1.0):
        pen.line([(0, y), (WIDTH, y)], fill=(*_INK, 100))
        _write(pen, (2, y - 14), f"{position:.2f}")

    across = "xyz"[right]
    along = "xyz"[up]
    _write(pen, (WIDTH - 60, HEIGHT - 32), f"{across} (m)")
    _write(pen, (40, 4), f"{along} (m)")

    minus = "-" if sign < 0 else ""

    return (
        f"parallel projection, {minus}{across} to the right and {along} up, {WIDTH} x {HEIGHT} pixels, "
        f"{1000 / per_m:.3f} mm per pixel; scales and grid in metres; outlines are drawn also of what is hidden"
    )


def _list_lines(
    middle: float,
    pixels: int,
    per_m: float,
    step: float,
    sign: float,
) -> list[tuple[float, float]]:
    """List the lines across an axis: where each is in the world, metres, and in the picture, pixels.

    Args:
        middle: of the picture along the axis, metres.
        pixels: of the picture's side along it.
        per_m: pixels in a metre.
        step: between two lines, metres.
        sign: 1.0 where the axis grows with the pixels, else -1.0.
    """
    half = pixels / 2 / per_m
    first = math.ceil((middle - half) / step)
    last = math.floor((middle + half) / step)

    lines = []
    for number in range(first, last + 1):
        position = number * step
        place = pixels / 2 + sign * (position - middle) * per_m
        lines.append((position + 0.0, place))

    return lines


def _write(pen: ImageDraw.ImageDraw, place: tuple[float, float], text: str) -> None:
    """Write a line on a pale ground, from its left upper corner, pixels."""
    box = pen.textbbox(place, text, font_size=_FONT)
    pen.rectangle(box, fill=(*_PALE, 190))
    pen.text(place, text, fill=_INK, font_size=_FONT)


def _draw_edges(
    picture: Pillow.Image,
    camera: Camera,
    bodies: Sequence[Body],
    covered: Sequence[npt.NDArray[np.bool_]],
) -> None:
    """Draw edges in a parallel view, and the outline of each body, also of what is clear or hidden.

    Edges are where the distance to the camera bends or steps; they are drawn in ink, and pale on what is dark.

    Args:
        picture: that is drawn on.
        camera: a parallel one.
        bodies: that edges are drawn of.
        covered: the pixels (H, W) that each of them covers.
    """
    near = nearness(bodies, camera, WIDTH, HEIGHT)
    edges = np.zeros((HEIGHT, WIDTH), dtype=bool)
    edges[1:-1] |= np.abs(np.diff(near, 2, axis=0)) > _EDGE_M
    edges[:, 1:-1] |= np.abs(np.diff(near, 2, axis=1)) > _EDGE_M

    for silhouette in covered:
        edges |= silhouette & ~binary_erosion(silhouette, border_value=1)

    gray = picture.convert("L")
    ink = gray.point(lambda light: _PALE[0] if light < _DARK else _INK[0])

    mask = Pillow.fromarray(_OPAQUE * edges.astype(np.uint8))
    picture.paste(ink.convert("RGB"), mask=mask)


class _Labels:
    """Marks of bodies in a picture: the origin of each one's frame, its axes x and y, and its name.

        _Labels(picture, camera, covered).draw(bodies)

    No name covers a body or another name: each has the nearest place that is free, or the one that covers least.
    """

    def __init__(
        self,
        picture: Pillow.Image,
        camera: Camera,
        covered: Sequence[npt.NDArray[np.bool_]],
    ) -> None:
        self._pen = ImageDraw.Draw(picture)
        self._camera = camera
        self._taken = np.any(covered, axis=0)

    def draw(self, bodies: Sequence[Body]) -> None:
        """Mark the bodies that are in the picture; of many alike, only the first and the last have their names.

        Args:
            bodies: where they are in the layout.
        """
        alike = Counter(_strip_number(body) for body in bodies)
        seen = Counter[str]()

        for body in bodies:
            x, y = self._project(body.pose)
            if not (0 <= x < WIDTH and 0 <= y < HEIGHT):
                continue

            self._draw_axes(body.pose)
            kind = _strip_number(body)
            seen[kind] += 1

            if alike[kind] <= _ALL or seen[kind] in (1, alike[kind]):
                self._draw_name(body.name, x, y)

    def _project(self, pose: Pose) -> tuple[float, float]:
        """Compute where the origin of a frame is in the picture, pixels.

        Args:
            pose: of the frame in the world.
        """
        x, y = project(self._camera, pose.position, WIDTH, HEIGHT).tolist()
        return x, y

    def _draw_axes(self, pose: Pose) -> None:
        """Draw the axes x and y of a frame, and a ring about its origin.

        Args:
            pose: of the frame in the world.
        """
        x, y = self._project(pose)
        self._taken[int(y) - 6 : int(y) + 7, int(x) - 6 : int(x) + 7] = True
        for axis, color in ((0, _RED), (1, _GREEN)):
            tip = pose @ Pose(_AXIS_M * np.eye(3)[axis])
            self._pen.line([(x, y), self._project(tip)], fill=color, width=2)

        self._pen.ellipse([(x - 3, y - 3), (x + 3, y + 3)], outline=_INK)

    def _draw_name(
        self,
        name: str,
        x: float,
        y: float,
    ) -> None:
        """Write a name near a point, with a line to it.

        Args:
            name: of the body.
            x: of its origin, pixels.
            y: of its origin, pixels.
        """
        pen = self._pen
        width = int(pen.textlength(name, font_size=_FONT)) + 4
        left, top = self._find_place(x, y, width)
        self._taken[top : top + _HIGH, left : left + width] = True

        end = min(max(x, left), left + width), min(max(y, top), top + _HIGH)
        pen.line([(x, y), end], fill=_INK, width=1)
        pen.rectangle([(left, top), (left + width, top + _HIGH)], fill=_PALE)
        pen.text((left + 2, top + 1), name, fill=_INK, font_size=_FONT)

    def _find_place(self, x: float, y: float, width: int) -> tuple[int, int]:
        """Find where a name near a point covers nothing: its left upper corner, pixels.

        Args:
            x: of the point, pixels.
            y: of the point, pixels.
            width: of the name, pixels.
        """
        size = (_HIGH + 4, width + 4)
        covered = maximum_filter(self._taken, size, mode="constant", cval=True)
        rows, columns = np.indices(covered.shape)
        away = np.hypot(columns - x, rows - y) + np.hypot(WIDTH, HEIGHT) * covered
        row, column = np.unravel_index(away.argmin(), away.shape)
        return int(column) - width // 2, int(row) - _HIGH // 2


def _strip_number(body: Body) -> str:
    """Return a body's name without its number.

    Args:
        body: such as the third of several alike.
    """
    return body.name.rstrip("0123456789")

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
from scipy.ndimage import binary_erosion, gaussian_filter

from core.geometry import Array, Pose
from core.interfaces import Image, Picture, Task
from core.scene import Body, Camera
from core.simulation.pictures import describe_camera, png
from plugins.vlms.told.bodies import bounds, bounds_in_world
from plugins.vlms.told.nearness import nearness
from plugins.vlms.told.projection import project

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


_VIEWS = {
    "front": _View((-1.0, 0.0, 0.0), 1, 2),
    "side": _View((0.0, -1.0, 0.0), 0, 2),
    "top": _View((0.0, 0.0, 1.0), 0, 1),
}


def calibrated_pictures(
    task: Task,
    seed: int,
    render: Callable[..., Image],
) -> tuple[Picture, ...]:
    """Draw the scene at the start: from the task's camera, closer, from the robot's side, and in parallel views.

    For ``render`` see `core.task.Level.draw`.

    Args:
        task: whose scene and camera it is about.
        seed: of the layout.
        render: draws the scene from a camera, without what is written on it.

    Returns:
        In the order in which a prompt shows them, each with its caption.

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
        **{name: parallel_camera(name, bodies) for name in _VIEWS},
    }

    pictures = []
    for name, camera in cameras.items():
        picture = Pillow.fromarray(render(camera=camera, width=WIDTH, height=HEIGHT))
        if name in _VIEWS:
            near = nearness(small, camera, WIDTH, HEIGHT)
            picture = _light(picture, near)
            _draw_edges(picture, camera, small, near)
            caption = _Grid(picture, camera, _VIEWS[name]).draw()
        else:
            caption = describe_camera(camera, SIZE)

        _Labels(picture, camera).draw(small)
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


def parallel_camera(name: str, bodies: Sequence[Body]) -> Camera:
    """Make the camera of a parallel view, which shows all bodies but what is as large as a table.

    Args:
        name: ``front``, ``side`` or ``top``.
        bodies: of the layout.
    """
    view = _VIEWS[name]
    low, high = bounds_in_world(_find_small(bodies) or bodies)
    backward = np.array(view.backward)

    room = high - low + 2 * _ROOM_M
    tall = room[view.up] * HEIGHT / (HEIGHT - 2 * _MARGIN)
    wide = room[view.right] * HEIGHT / (WIDTH - 2 * _MARGIN)

    middle = (low + high) / 2
    away = float(np.abs(backward @ (high - low))) / 2 + _ROOM_M / 2
    x, y, z = (middle + away * backward).tolist()

    return Camera((x, y, z), tuple(middle.tolist()), 2.0, float(max(tall, wide)))


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


class _Grid:
    """Lines and scales in metres over a parallel view.

        caption = _Grid(picture, camera, view).draw()

    Positions can be read off, and distances measured in pixels.
    """

    def __init__(
        self,
        picture: Pillow.Image,
        camera: Camera,
        view: _View,
    ) -> None:
        """Choose how far lines are apart: the closest distance of which there are not too many.

        Args:
            picture: that is drawn on.
            camera: a parallel one, which took the picture.
            view: the camera's direction.
        """
        assert camera.height_m is not None
        self._pen = ImageDraw.Draw(picture, "RGBA")
        self._camera = camera

        self._view = view
        self._per_m = HEIGHT / camera.height_m

        enough = [step for step in _STEPS if WIDTH / self._per_m / step <= _LINES]
        self._step = min(enough, default=_STEPS[-1])

    def draw(self) -> str:
        """Draw it, and say what one needs to measure in the picture.

        Returns:
            A part of the picture's caption.
        """
        right = self._view.right
        up = self._view.up
        sign = float(np.sign(self._camera.axes[0][right]))

        for position, x in self._lines(right, WIDTH, sign):
            self._draw_line([(x, 0), (x, HEIGHT)], (x + 2, HEIGHT - 15), position)

        for position, y in self._lines(up, HEIGHT, -1.0):
            self._draw_line([(0, y), (WIDTH, y)], (2, y - 14), position)

        self._write((WIDTH - 60, HEIGHT - 32), f"{'xyz'[right]} (m)")
        self._write((40, 4), f"{'xyz'[up]} (m)")

        minus = "-" if sign < 0 else ""

        return (
            f"parallel projection, {minus}{'xyz'[right]} to the right and {'xyz'[up]} up, {WIDTH} x {HEIGHT} pixels, "
            f"{1000 / self._per_m:.3f} mm per pixel; scales and grid in metres; "
            "outlines are drawn also of what is hidden"
        )

    def _lines(
        self,
        axis: int,
        pixels: int,
        sign: float,
    ) -> list[tuple[float, float]]:
        """Return the lines across an axis: where each is in the world, metres, and in the picture, pixels.

        Args:
            axis: number of the world's axis.
            pixels: of the picture's side along it.
            sign: 1.0 where the axis grows with the pixels, else -1.0.
        """
        middle = self._camera.target[axis]
        half = pixels / 2 / self._per_m
        first = math.ceil((middle - half) / self._step)
        last = math.floor((middle + half) / self._step)

        lines = []

        for number in range(first, last + 1):
            position = number * self._step
            place = pixels / 2 + sign * (position - middle) * self._per_m
            lines.append((position + 0.0, place))

        return lines

    def _draw_line(
        self,
        ends: list[tuple[float, float]],
        place: tuple[float, float],
        position: float,
    ) -> None:
        """Draw a line between two ends, and write its position at a place.

        Args:
            ends: of the line, pixels.
            place: of the text's left upper corner, pixels.
            position: of the line in the world, metres.
        """
        self._pen.line(ends, fill=(*_INK, 100))
        self._write(place, f"{position:.2f}")

    def _write(self, place: tuple[float, float], text: str) -> None:
        """Write a text on a pale ground.

        Args:
            place: of the text's left upper corner, pixels.
            text: of one line.
        """
        box = self._pen.textbbox(place, text, font_size=_FONT)
        self._pen.rectangle(box, fill=(*_PALE, 190))
        self._pen.text(place, text, fill=_INK, font_size=_FONT)


def _draw_edges(
    picture: Pillow.Image,
    camera: Camera,
    bodies: Sequence[Body],
    near: Array,
) -> None:
    """Draw edges in a parallel view, and the outline of each body, also of what is clear or hidden.

    Edges are where the distance to the camera bends or steps; they are drawn in ink, and pale on what is dark.

    Args:
        picture: that is drawn on.
        camera: a parallel one.
        bodies: that edges are drawn of.
        near: how far they reach toward the camera, (H, W) metres.
    """
    edges = np.zeros((HEIGHT, WIDTH), dtype=bool)
    edges[1:-1] |= np.abs(np.diff(near, 2, axis=0)) > _EDGE_M
    edges[:, 1:-1] |= np.abs(np.diff(near, 2, axis=1)) > _EDGE_M

    for body in bodies:
        silhouette = _fill(body, camera)
        edges |= silhouette & ~binary_erosion(silhouette, border_value=1)

    gray = picture.convert("L")
    ink = gray.point(lambda light: _PALE[0] if light < _DARK else _INK[0])

    mask = Pillow.fromarray(_OPAQUE * edges.astype(np.uint8))
    picture.paste(ink.convert("RGB"), mask=mask)


def _fill(body: Body, camera: Camera) -> npt.NDArray[np.bool_]:
    """Compute which pixels (H, W) a body covers.

    Args:
        body: of which all visible parts count.
        camera: that takes the picture.
    """
    silhouette = Pillow.new("1", SIZE)
    pen = ImageDraw.Draw(silhouette)

    for part in body.visuals:
        mesh = part.shape.to_trimesh()
        vertices = np.asarray(mesh.vertices, dtype=np.float64)
        placed = (body.pose @ part.pose).apply(vertices)
        pixels = project(camera, placed, WIDTH, HEIGHT)

        for corners in pixels[np.asarray(mesh.faces)]:
            pen.polygon([(x, y) for x, y in corners.tolist()], fill=1)

    return np.asarray(silhouette)


class _Labels:
    """Marks of bodies in a picture: the origin of each one's frame, its axes x and y, and its name.

        _Labels(picture, camera).draw(bodies)

    No name covers a body or another name: each has the nearest place that is free, or the one that covers least.
    """

    def __init__(self, picture: Pillow.Image, camera: Camera) -> None:
        self._pen = ImageDraw.Draw(picture)
        self._camera = camera
        self._taken = np.zeros((HEIGHT, WIDTH), dtype=bool)

    def draw(self, bodies: Sequence[Body]) -> None:
        """Mark the bodies that are in the picture; of many alike, only the first and the last have their names.

        Args:
            bodies: where they are in the layout.
        """
        alike = Counter(_strip_number(body) for body in bodies)
        seen = Counter[str]()

        for body in bodies:
            self._taken |= _fill(body, self._camera)

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
        places = {}
        for away in range(14, 300, 12):
            for turn in np.linspace(0.0, 2 * np.pi, 16, endpoint=False):
                left = int(
                    np.clip(x + away * np.cos(turn) - width / 2, 1, WIDTH - width - 2)
                )
                top = int(
                    np.clip(y + away * np.sin(turn) - _HIGH / 2, 1, HEIGHT - _HIGH - 2)
                )
                covered = self._taken[
                    top - 1 : top + _HIGH + 1, left - 1 : left + width + 1
                ]
                places[left, top] = int(covered.sum())
                if not places[left, top]:
                    return left, top

        return min(places, key=places.__getitem__)


def _strip_number(body: Body) -> str:
    """Return a body's name without its number.

    Args:
        body: such as the third of several alike.
    """
    return body.name.rstrip("0123456789")

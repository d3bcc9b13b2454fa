"""Draw a scene for a designer that is told no number: calibrated pictures."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from PIL import Image as Pillow
from PIL import ImageDraw
from scipy.ndimage import binary_erosion

from core.geometry import Array, Pose
from core.interfaces import Image, Picture, Task
from core.scene import Body, Camera
from core.simulation.pictures import describe_camera, png
from plugins.vlms.told.bodies import bounds
from plugins.vlms.told.nearness import nearness

SIZE = 1000, 750  # pixels
_ROOM_M = 0.06  # around what a parallel camera shows; it stands half of that before it, and cuts off what is behind it
_LARGE_M = 1.2  # what is larger, as table and floor, does not set what is shown
_ROUND_M = 0.05  # of what a camera looks at: its caption must not tell where a body is
_AXIS_M = 0.04  # length of a drawn axis
_ALL = 14  # of so many bodies alike each has a label, of more the first and the last
_STEPS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)  # metres, between lines
_LINES = 18  # along a side, at most
_MARGIN = 46  # pixels of a scale
_OPAQUE, _DARK = (
    150,
    100,
)  # of 255: the opacity of drawn edges, and the brightness below which they are pale
_EDGE_M = 0.002  # a bend or a step that is drawn as an edge
_INK, _PALE, _RED, _GREEN = (20, 20, 20), (255, 255, 255), (210, 30, 30), (20, 150, 40)
# By name: from the scene to the camera, the axis to the right and the axis up in the picture.
_PARALLEL = {
    "front": ((-1.0, 0.0, 0.0), 1, 2),
    "side": ((0.0, -1.0, 0.0), 0, 2),
    "top": ((0.0, 0.0, 1.0), 0, 1),
}


def calibrated_pictures(
    task: Task, seed: int, render: Callable[..., Image]
) -> tuple[Picture, ...]:
    """Draw the scene at the start: from the task's camera, closer, and in parallel views with axes and grid in metres.

    For ``render`` see `core.task.Level.draw`.

    Raises:
        NoPicture: nothing here can draw.
    """
    bodies = list(task.scene(seed).bodies)
    small = [body for body in bodies if _size(body) < _LARGE_M]
    moving = [body for body in bodies if body.mass] or bodies
    cameras = {"scene": task.camera, "close": _closer(task.camera, *_extent(moving))}
    cameras |= {name: _parallel(name, *_shown(bodies)) for name in _PARALLEL}
    pictures = []
    for name, camera in cameras.items():
        picture = Pillow.fromarray(render(camera=camera, width=SIZE[0], height=SIZE[1]))
        said = describe_camera(camera, SIZE)
        if name in _PARALLEL:
            _draw_edges(picture, camera, small)
            said = _draw_grid(picture, camera, *_PARALLEL[name][1:])
        _label(picture, camera, small)
        pictures.append(Picture(png(np.asarray(picture)), name, f"{name}: {said}"))
    return tuple(pictures)


def _size(body: Body) -> float:
    low, high = bounds(body, Pose())
    return float((high - low).max())


def _shown(bodies: list[Body]) -> tuple[Array, Array]:
    """Compute the corners of what parallel views show: all but what is as large as a table."""
    return _extent([body for body in bodies if _size(body) < _LARGE_M] or bodies)


def _extent(bodies: list[Body]) -> tuple[Array, Array]:
    """Compute the lowest and the highest corner (3,) of bodies in the world."""
    lows, highs = zip(*(bounds(body, body.pose) for body in bodies), strict=True)
    return np.min(lows, axis=0), np.max(highs, axis=0)


def _parallel(name: str, low: Array, high: Array) -> Camera:
    backward, right, up = _PARALLEL[name]
    middle = (low + high) / 2
    room = high - low + 2 * _ROOM_M
    inside = np.array(SIZE) - 2 * _MARGIN
    shown = max(room[up] * SIZE[1] / inside[1], room[right] * SIZE[1] / inside[0])
    away = float(np.abs(np.array(backward) @ (high - low))) / 2 + _ROOM_M / 2
    x, y, z = (middle + away * np.array(backward)).tolist()
    return Camera((x, y, z), tuple(middle.tolist()), 2.0, float(shown))


def _closer(camera: Camera, low: Array, high: Array) -> Camera:
    """Look from the same place at what is between two corners, (3,) each."""
    middle = _ROUND_M * np.round((low + high) / 2 / _ROUND_M)
    away = float(np.linalg.norm(np.asarray(camera.position) - middle))
    half = max(float(np.linalg.norm(high - low)) / 2, 0.08) + _ROUND_M / 2
    return replace(
        camera,
        target=tuple(middle.tolist()),
        fov_deg=float(np.degrees(2 * np.arctan(half / away))) * 1.15,
    )


def _draw_grid(picture: Pillow.Image, camera: Camera, right: int, up: int) -> str:
    """Draw lines and scales in metres over a parallel view, and say what one needs to measure in it."""
    assert camera.height_m is not None
    pen = ImageDraw.Draw(picture, "RGBA")
    per_m = SIZE[1] / camera.height_m
    step = next(
        (step for step in _STEPS if SIZE[0] / per_m / step <= _LINES), _STEPS[-1]
    )
    signs = float(np.sign(camera.axes[0][right])), -1.0
    for side, axis in enumerate((right, up)):
        middle = camera.target[axis]
        half = SIZE[side] / 2 / per_m
        for k in range(
            math.ceil((middle - half) / step), math.floor((middle + half) / step) + 1
        ):
            at = SIZE[side] / 2 + signs[side] * (k * step - middle) * per_m
            vertical = side == 0
            pen.line(
                [(at, 0), (at, SIZE[1])] if vertical else [(0, at), (SIZE[0], at)],
                fill=(*_INK, 100),
            )
            _write(
                pen,
                (at + 2, SIZE[1] - 15) if vertical else (2, at - 14),
                f"{k * step + 0.0:.2f}",
            )
    _write(pen, (SIZE[0] - 60, SIZE[1] - 32), f"{'xyz'[right]} (m)")
    _write(pen, (40, 4), f"{'xyz'[up]} (m)")
    return (
        f"parallel projection, {'-' if signs[0] < 0 else ''}{'xyz'[right]} to the right and {'xyz'[up]} up, "
        f"{SIZE[0]} x {SIZE[1]} pixels, {1000 / per_m:.3f} mm per pixel; scales and grid in metres; "
        "outlines are drawn also of what is hidden"
    )


def _write(pen: ImageDraw.ImageDraw, place: tuple[float, float], text: str) -> None:
    pen.rectangle(pen.textbbox(place, text, font_size=12), fill=(*_PALE, 190))
    pen.text(place, text, fill=_INK, font_size=12)


def _draw_edges(picture: Pillow.Image, camera: Camera, bodies: list[Body]) -> None:
    """Draw edges in a parallel view, and the outline of each body, also of what is clear or hidden."""
    ink = (
        picture.convert("L")
        .point(lambda light: _PALE[0] if light < _DARK else _INK[0])
        .convert("RGB")
    )
    near = nearness(bodies, camera, *SIZE)
    edges = np.zeros(SIZE[::-1], dtype=bool)
    edges[1:-1] |= np.abs(np.diff(near, 2, axis=0)) > _EDGE_M
    edges[:, 1:-1] |= np.abs(np.diff(near, 2, axis=1)) > _EDGE_M
    for body in bodies:
        outline = Pillow.new("1", SIZE)
        pen = ImageDraw.Draw(outline)
        for part in body.visuals:
            mesh = part.shape.to_trimesh()
            pixels = camera.project(
                (body.pose @ part.pose).apply(
                    np.asarray(mesh.vertices, dtype=np.float64)
                ),
                *SIZE,
            )
            for corners in pixels[np.asarray(mesh.faces)]:
                pen.polygon([(x, y) for x, y in corners.tolist()], fill=1)
        filled = np.asarray(outline)
        edges |= filled & ~binary_erosion(filled, border_value=1)
    picture.paste(ink, mask=Pillow.fromarray(_OPAQUE * edges.astype(np.uint8)))


def _label(picture: Pillow.Image, camera: Camera, bodies: list[Body]) -> None:
    """Mark the origin of each body's frame, its axes x and y, and write its name where no other name is."""
    pen = ImageDraw.Draw(picture)
    alike = Counter(body.name.rstrip("0123456789") for body in bodies)
    seen = Counter[str]()
    taken: list[tuple[float, float, float, float]] = []
    for body in bodies:
        x, y = camera.project(body.pose.position, *SIZE).tolist()
        if not (0 <= x < SIZE[0] and 0 <= y < SIZE[1]):
            continue
        for axis, color in ((0, _RED), (1, _GREEN)):
            end = camera.project(
                (body.pose @ Pose(_AXIS_M * np.eye(3)[axis])).position, *SIZE
            )
            pen.line([(x, y), (float(end[0]), float(end[1]))], fill=color, width=2)
        pen.ellipse([(x - 3, y - 3), (x + 3, y + 3)], outline=_INK)
        kind = body.name.rstrip("0123456789")
        seen[kind] += 1
        if alike[kind] > _ALL and 1 < seen[kind] < alike[kind]:
            continue
        box = _free_place(x, y, pen.textlength(body.name, font_size=12) + 4, taken)
        taken.append(box)
        pen.line([(x, y), (box[0], (box[1] + box[3]) / 2)], fill=_INK, width=1)
        pen.rectangle(box, fill=_PALE)
        pen.text((box[0] + 2, box[1] + 1), body.name, fill=_INK, font_size=12)


def _free_place(
    x: float, y: float, wide: float, taken: list[tuple[float, float, float, float]]
) -> tuple[float, float, float, float]:
    """Find a box for a name near a point that covers no other name."""
    for turn in range(60):
        left = min(x + 14 + 4 * turn, SIZE[0] - wide - 1)
        top = min(max(y + 4 + (-1) ** turn * 9 * turn, 1.0), SIZE[1] - 17.0)
        box = (left, top, left + wide, top + 16)
        if all(
            box[2] < a or box[0] > c or box[3] < b or box[1] > d for a, b, c, d in taken
        ):
            break
    return box

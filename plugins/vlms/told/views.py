"""Draw a scene for a designer that is told no number: calibrated pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from PIL import Image as Pillow
from PIL import ImageDraw

from core.geometry import Array, Pose
from core.interfaces import Image, Picture, Task
from core.scene import Body, Camera
from core.simulation.pictures import describe_camera, nearness, png
from plugins.vlms.told.bodies import own_bounds

SIZE = 1000, 750  # pixels
_ROOM_M = 0.06  # around what a parallel camera shows; it stands half of that before it, and cuts off what is behind it
_LARGE_M = 1.2  # what is larger, as table and floor, does not set what is shown
_ROUND_M = 0.05  # of what a camera looks at: its caption must not tell where a body is
_AXIS_M = 0.04  # length of a drawn axis
_ALL = 14  # of so many bodies alike each has a label, of more the first and the last
_STEPS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)  # metres, between lines
_LINES = 12  # along a side, about
_MARGIN = 46  # pixels of a scale
_OPAQUE, _DARK = 150, 100  # of 255: the opacity of drawn edges, and the brightness below which they are pale
_EDGE_M = 0.002  # a bend or a step that is drawn as an edge
_INK, _PALE, _RED, _GREEN = (20, 20, 20), (255, 255, 255), (210, 30, 30), (20, 150, 40)
# By name: from the scene to the camera, the axis to the right and the axis up in the picture.
_PARALLEL = {
    "front": ((-1.0, 0.0, 0.0), 1, 2),
    "side": ((0.0, -1.0, 0.0), 0, 2),
    "top": ((0.0, 0.0, 1.0), 0, 1),
}


def calibrated_pictures(task: Task, seed: int, render: Callable[..., Image]) -> tuple[Picture, ...]:
    """Draw the scene at the start: from the task's camera, closer, and in parallel views with axes and grid in metres.

    For ``render`` see `core.task.Level.draw`.

    Raises:
        NoPicture: nothing here can draw.
    """
    bodies = list(task.scene(seed).bodies)
    low, high = _shown(bodies)
    moving = [body for body in bodies if body.mass] or bodies
    cameras = {"scene": task.camera, "close": _closer(task.camera, *_extent(moving))}
    cameras |= {name: _parallel(name, low, high) for name in _PARALLEL}
    made = []
    for name, camera in cameras.items():
        picture = Pillow.fromarray(render(camera=camera, width=SIZE[0], height=SIZE[1]))
        if camera.height_m is not None:
            _draw_edges(picture, camera, [body for body in bodies if _size(body) < _LARGE_M])
            draw_grid(picture, camera, *_PARALLEL[name][1:])
        _label(picture, camera, bodies)
        made.append(Picture(png(np.asarray(picture)), name, f"{name}: {_described(camera, name)}"))
    return tuple(made)


def top_camera(task: Task, seed: int) -> Camera:
    """Return the camera of the view from above."""
    return _parallel("top", *_shown(list(task.scene(seed).bodies)))


def _described(camera: Camera, name: str) -> str:
    """Say how a picture is made: what one needs to measure in it."""
    if camera.height_m is None:
        return describe_camera(camera, SIZE)
    _, right, up = _PARALLEL[name]
    sign = "-" if camera.axes[0][right] < 0 else ""
    return (
        f"parallel projection, {sign}{'xyz'[right]} to the right and {'xyz'[up]} up, {SIZE[0]} x {SIZE[1]} pixels, "
        f"{1000 * camera.height_m / SIZE[1]:.3f} mm per pixel; scales and grid in metres; "
        "outlines are drawn also of what is hidden"
    )


def _size(body: Body) -> float:
    low, high = own_bounds(body)
    return float((high - low).max())


def _shown(bodies: list[Body]) -> tuple[Array, Array]:
    """Compute the corners of what parallel views show: all but what is as large as a table."""
    return _extent([body for body in bodies if _size(body) < _LARGE_M] or bodies)


def _extent(bodies: list[Body]) -> tuple[Array, Array]:
    """Compute the lowest and the highest corner (3,) of bodies in the world."""
    corners = []
    for body in bodies:
        low, high = own_bounds(body)
        corners.append(body.pose.apply(np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T))
    every = np.concatenate(corners)
    return every.min(axis=0), every.max(axis=0)


def _parallel(name: str, low: Array, high: Array) -> Camera:
    backward, right, up = _PARALLEL[name]
    middle, room = (low + high) / 2, high - low + 2 * _ROOM_M
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
    return replace(camera, target=tuple(middle.tolist()), fov_deg=float(np.degrees(2 * np.arctan(half / away))) * 1.15)


def draw_grid(picture: Pillow.Image, camera: Camera, right: int, up: int) -> None:
    """Draw lines and scales in metres over a parallel view."""
    assert camera.height_m is not None
    pen, per_m = ImageDraw.Draw(picture, "RGBA"), SIZE[1] / camera.height_m
    step = next((step for step in _STEPS if SIZE[0] / per_m / step <= 1.5 * _LINES), _STEPS[-1])
    middle, signs = np.asarray(camera.target), (np.sign(camera.axes[0][right]), -1.0)
    for axis, side, sign in ((right, 0, signs[0]), (up, 1, signs[1])):
        half = SIZE[side] / 2 / per_m
        first, last = np.ceil((middle[axis] - half) / step), np.floor((middle[axis] + half) / step)
        for k in np.arange(first, last + 1):
            at = SIZE[side] / 2 + sign * (k * step - middle[axis]) * per_m
            ends = [(at, 0), (at, SIZE[1])] if side == 0 else [(0, at), (SIZE[0], at)]
            pen.line(ends, fill=(*_INK, 70 if k % 5 else 130), width=1)
            text, place = f"{k * step + 0.0:.2f}", (at + 2, SIZE[1] - 15) if side == 0 else (2, at - 14)
            pen.rectangle(pen.textbbox(place, text, font_size=12), fill=(*_PALE, 190))
            pen.text(place, text, fill=_INK, font_size=12)
    for place, axis in (((SIZE[0] - 60, SIZE[1] - 32), right), ((40, 4), up)):
        pen.rectangle(pen.textbbox(place, f"{'xyz'[axis]} (m)", font_size=14), fill=(*_PALE, 190))
        pen.text(place, f"{'xyz'[axis]} (m)", fill=_INK, font_size=14)


def _draw_edges(picture: Pillow.Image, camera: Camera, bodies: list[Body]) -> None:
    """Draw edges in a parallel view, and the outline of each body, also of what is clear or hidden."""
    ink = picture.convert("L").point(lambda light: _PALE[0] if light < _DARK else _INK[0]).convert("RGB")
    near, edges = nearness(bodies, camera, *SIZE), np.zeros(SIZE[::-1], dtype=bool)
    edges[1:-1] |= np.abs(np.diff(near, 2, axis=0)) > _EDGE_M
    edges[:, 1:-1] |= np.abs(np.diff(near, 2, axis=1)) > _EDGE_M
    for body in bodies:
        outline = Pillow.new("L", SIZE)
        pen = ImageDraw.Draw(outline)
        for part in body.visuals:
            mesh = part.shape.to_trimesh()
            pixels = camera.project((body.pose @ part.pose).apply(np.asarray(mesh.vertices, dtype=np.float64)), *SIZE)
            for corners in pixels[np.asarray(mesh.faces)]:
                pen.polygon([(x, y) for x, y in corners.tolist()], fill=255)
        filled = np.asarray(outline) > 0
        inside = filled[1:-1, 1:-1] & filled[2:, 1:-1] & filled[:-2, 1:-1] & filled[1:-1, 2:] & filled[1:-1, :-2]
        edges[1:-1, 1:-1] |= filled[1:-1, 1:-1] & ~inside
    picture.paste(ink, mask=Pillow.fromarray(_OPAQUE * edges.astype(np.uint8)))


def _label(picture: Pillow.Image, camera: Camera, bodies: list[Body]) -> None:
    """Mark the origin of each body's frame, its axes x and y, and write its name where no other name is."""
    pen = ImageDraw.Draw(picture)
    alike: dict[str, list[str]] = {}
    for body in bodies:
        alike.setdefault(body.name.rstrip("0123456789"), []).append(body.name)
    named = {name for own in alike.values() for name in (own if len(own) <= _ALL else (own[0], own[-1]))}
    taken: list[tuple[float, float, float, float]] = []
    for body in bodies:
        if _size(body) >= _LARGE_M:
            continue
        x, y = camera.project(body.pose.position, *SIZE).tolist()
        if not (0 <= x < SIZE[0] and 0 <= y < SIZE[1]):
            continue
        for axis, color in ((0, _RED), (1, _GREEN)):
            end = camera.project((body.pose @ Pose(_AXIS_M * np.eye(3)[axis])).position, *SIZE)
            pen.line([(x, y), (float(end[0]), float(end[1]))], fill=color, width=2)
        pen.line([(x - 5, y), (x + 5, y)], fill=_INK, width=1)
        pen.line([(x, y - 5), (x, y + 5)], fill=_INK, width=1)
        if body.name in named:
            box = _free_place(pen, body.name, x, y, taken)
            taken.append(box)
            pen.line([(x, y), (box[0], (box[1] + box[3]) / 2)], fill=_INK, width=1)
            pen.rectangle(box, fill=_PALE)
            pen.text((box[0] + 2, box[1] + 1), body.name, fill=_INK, font_size=12)


def _free_place(
    pen: ImageDraw.ImageDraw, name: str, x: float, y: float, taken: list[tuple[float, float, float, float]]
) -> tuple[float, float, float, float]:
    """Find a box for a name near a point that covers no other name."""
    wide = pen.textlength(name, font_size=12) + 4
    for turn in range(60):
        left = min(x + 14 + 4 * turn, SIZE[0] - wide - 1)
        top = y + 4 + (-1) ** turn * 9 * turn
        top = min(max(top, 1.0), SIZE[1] - 17.0)
        box = (left, top, left + wide, top + 16)
        if all(box[2] < a or box[0] > c or box[3] < b or box[1] > d for a, b, c, d in taken):
            break
    return box

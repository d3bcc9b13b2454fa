"""Draw a scene from the front, from the side and from above: parallel projections with axes and bodies' names."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from PIL import Image as Pillow
from PIL import ImageDraw
from scipy.spatial import ConvexHull

from core.design import Tool
from core.designs.rules import MAX_COMPONENTS
from core.geometry import Array
from core.interfaces import Image, Simulator, Task
from core.robot.frames import link_frames
from core.robot.trajectory import at_home
from core.scene import Body, Camera

SIZE = 640, 480  # pixels
_TOOL = 320  # of a view of a tool, each way
_LEFT, _RIGHT, _TOP, _BOTTOM = 44, 10, 22, 34  # the margins that hold the axes, pixels
_AWAY_M = 4.0  # of the camera from the middle of the scene
_WIDE_M = 3.0  # wider parts, such as a floor, reach beyond the picture
_LARGE_M = 1.0  # larger bodies, such as a table, get no outline
_BELOW_M = 0.1  # shown of what is below everything that can move
_ARM_M = 0.1  # about the thickness of the arm
_ROOM = 1.1
_LONG = 3.0  # a name so many times as wide as its body is left out
_STEPS_M = (0.05, 0.1, 0.2, 0.5, 1.0)
_LEAST_STEP = 38  # pixels from one line to the next
_INK, _LINE, _MARK = (30, 30, 30), (90, 90, 90, 70), (150, 0, 130, 255)
_FONT = 13


class _View(NamedTuple):
    title: str
    backward: tuple[float, float, float]  # from the scene to the camera
    right: int  # the axis to the right, and
    up: int


_VIEWS = {
    "front": _View("front view, seen from +x: y to the right, z up, in metres", (1.0, 0.0, 0.0), 1, 2),
    "side": _View("side view, seen from -y: x to the right, z up, in metres", (0.0, -1.0, 0.0), 0, 2),
    "top": _View("top view, seen from +z: x to the right, y up, in metres", (0.0, 0.0, 1.0), 0, 1),
}


def draw_view(task: Task, simulator: Simulator, name: str, seed: int, tool: Tool | None) -> Image:
    """Draw the layout of ``seed`` with the arm at home, as a picture (480, 640, 3).

    ``name`` is ``front``, ``side``, ``top``, or ``camera``, which stands for the task's camera and has no axes. Lines
    and names show where bodies are, behind the arm too; some names are left out where many bodies lie close together.

    Raises:
        NoPicture: nothing here can draw.
    """
    if name not in _VIEWS:
        return simulator.render(task, seed=seed, tool=tool, width=SIZE[0], height=SIZE[1])
    view, camera = _VIEWS[name], view_camera(task, name, seed)
    width, height = SIZE[0] - _LEFT - _RIGHT, SIZE[1] - _TOP - _BOTTOM
    scene = simulator.render(task, seed=seed, tool=tool, camera=camera, width=width, height=height)
    drawn = Pillow.fromarray(scene).convert("RGBA")
    over = Pillow.new("RGBA", drawn.size)
    lines = ImageDraw.Draw(over)
    ticks = list(_ticks(camera, view, width, height))
    for _, axis, at in ticks:
        lines.line([(at, 0), (at, height)] if axis == view.right else [(0, at), (width, at)], fill=_LINE)
    named: list[tuple[float, ...]] = []
    for body in task.scene(seed).bodies:
        if body.visuals and np.ptp(_corners(body), axis=0).max() < _LARGE_M:
            _outline(lines, body.name, camera.project(_corners(body), width, height), named)
    picture = Pillow.new("RGB", SIZE, (255, 255, 255))
    picture.paste(Pillow.alpha_composite(drawn, over).convert("RGB"), (_LEFT, _TOP))
    pen = ImageDraw.Draw(picture)
    pen.rectangle([(_LEFT - 1, _TOP - 1), (_LEFT + width, _TOP + height)], outline=_INK)
    pen.text((SIZE[0] / 2, _TOP / 2), view.title, fill=_INK, anchor="mm", font_size=_FONT)
    for value, axis, at in ticks:
        text = f"{value:.2f}".rstrip("0").rstrip(".")
        if axis == view.right:
            pen.text((_LEFT + at, _TOP + height + 4), text, fill=_INK, anchor="ma", font_size=_FONT)
        else:
            pen.text((_LEFT - 5, _TOP + at), text, fill=_INK, anchor="rm", font_size=_FONT)
    pen.text((SIZE[0] - _RIGHT, SIZE[1] - 1), "xyz"[view.right], fill=_INK, anchor="rd", font_size=_FONT)
    pen.text((4, _TOP / 2), "xyz"[view.up], fill=_INK, anchor="lm", font_size=_FONT)
    return np.asarray(picture)


def draw_tool(task: Task, simulator: Simulator, seed: int, tool: Tool) -> Image:
    """Draw a tool with components at home from the front, the side and above, in one picture (320, 960, 3).

    Raises:
        NoPicture: nothing here can draw.
    """
    corners = _tool_corners(task, tool)
    bounds = corners.min(axis=0), corners.max(axis=0)
    picture = Pillow.new("RGB", (3 * _TOOL, _TOOL))
    for number, (name, view) in enumerate(_VIEWS.items()):
        camera = _camera(view, bounds, 1.0)
        drawn = Pillow.fromarray(simulator.render(task, seed=seed, tool=tool, camera=camera, width=_TOOL, height=_TOOL))
        pen = ImageDraw.Draw(drawn)
        pen.rectangle([(0, 0), (_TOOL, 17)], fill=(255, 255, 255))
        axes = f"{'xyz'[view.right]} right, {'xyz'[view.up]} up"
        pen.text((4, 2), f"{name}: {axes}, {1000 * (camera.height_m or 0):.0f} mm high", fill=_INK, font_size=_FONT)
        picture.paste(drawn, (number * _TOOL, 0))
    return np.asarray(picture)


def _tool_corners(task: Task, tool: Tool) -> Array:
    """The vertices (V, 3) of a tool at home, in the world; of at most `MAX_COMPONENTS` components."""
    home, placed, corners = at_home(task), tool.placed(), []
    frames = link_frames(task.robot, tool.gripper, home.arm, np.column_stack([home.fingers] * 2))
    for component in tool.components[:MAX_COMPONENTS]:
        mount, pose = placed[component.name]
        rotations, positions = frames[mount]
        points = pose.apply(np.asarray(component.shape.to_trimesh().vertices))
        corners.append(points @ rotations[0].T + positions[0])
    return np.concatenate(corners)


def view_camera(task: Task, name: str, seed: int) -> Camera:
    """Make the camera of a view, which shows the arm at home and all bodies that are not as wide as a floor."""
    aspect = (SIZE[0] - _LEFT - _RIGHT) / (SIZE[1] - _TOP - _BOTTOM)
    return _camera(_VIEWS[name], _bounds(task, seed), aspect)


def _camera(view: _View, bounds: tuple[Array, Array], aspect: float) -> Camera:
    """Make a camera that shows the space within ``bounds`` in a picture of ``aspect``, its width by its height."""
    low, high = bounds
    extent, middle = high - low, (low + high) / 2
    x, y, z = (middle + _AWAY_M * np.array(view.backward)).tolist()
    target_x, target_y, target_z = middle.tolist()
    shown = _ROOM * max(extent[view.up], extent[view.right] / aspect)
    fov_deg = float(np.degrees(2 * np.arctan(shown / 2 / _AWAY_M)))  # for an engine without parallel projection
    return Camera((x, y, z), (target_x, target_y, target_z), fov_deg, float(shown))


def _bounds(task: Task, seed: int) -> tuple[Array, Array]:
    home, scene = at_home(task), task.scene(seed)
    joints = np.array(
        [position[0] for _, position in link_frames(task.robot, False, home.arm, np.zeros((1, 0))).values()]
    )
    lows, highs = [joints.min(axis=0) - _ARM_M], [joints.max(axis=0) + _ARM_M]
    lowest = min([0.0, *(_corners(body)[:, 2].min() for body in scene.free)]) - _BELOW_M
    for body in scene.bodies:
        for points in _parts(body):
            low, high = points.min(axis=0), points.max(axis=0)
            if (high - low).max() < _WIDE_M and high[2] > lowest:
                lows.append(low)
                highs.append(high)
    low, high = np.min(lows, axis=0), np.max(highs, axis=0)
    return np.array([low[0], low[1], max(low[2], lowest)]), high


def _corners(body: Body) -> Array:
    """The vertices (V, 3) of all visual parts of a body, in the world."""
    return np.concatenate(_parts(body)) if body.visuals else body.pose.position[None]


def _parts(body: Body) -> list[Array]:
    return [(body.pose @ p.pose).apply(np.asarray(p.shape.to_trimesh().vertices)) for p in body.visuals]


def _ticks(camera: Camera, view: _View, width: int, height: int) -> Iterator[tuple[float, int, float]]:
    """Yield for each line of the grid the coordinate, its axis, and the pixel from the left or from the top."""
    assert camera.height_m is not None
    step = next((s for s in _STEPS_M if s * height / camera.height_m >= _LEAST_STEP), _STEPS_M[-1])
    for axis, pixels, column in ((view.right, width, 0), (view.up, height, 1)):
        reach = camera.height_m * pixels / height / 2
        for k in range(
            int(np.ceil((camera.target[axis] - reach) / step)), int((camera.target[axis] + reach) // step) + 1
        ):
            point = np.array(camera.target)
            point[axis] = k * step
            yield k * step, axis, float(camera.project(point, width, height)[column])


def _outline(lines: ImageDraw.ImageDraw, name: str, points: Array, named: list[tuple[float, ...]]) -> None:
    """Draw the hull of a body's points (V, 2), and its name if it is short and covers no name before it."""
    around = points[ConvexHull(points, qhull_options="QJ").vertices]  # QJ: points on a line do too
    lines.polygon([(float(x), float(y)) for x, y in around], outline=_MARK)
    (left, top), (right, _) = points.min(axis=0), points.max(axis=0)
    place = float(left + right) / 2, float(top) - 2
    box = lines.textbbox(place, name, anchor="md", font_size=_FONT)
    covers = any(box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in named)
    if not covers and box[2] - box[0] < _LONG * (right - left):
        lines.text(place, name, fill=_MARK, anchor="md", font_size=_FONT)
        named.append(box)

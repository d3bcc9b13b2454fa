"""Draw a tool from the front, from the side and from above: parallel projections with their axes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from PIL import Image as Pillow
from PIL import ImageDraw

from core.design import Tool
from core.designs.rules import MAX_COMPONENTS
from core.geometry import Array
from core.interfaces import Image, Simulator, Task
from core.robot.frames import link_frames
from core.robot.trajectory import at_home
from core.scene import Camera

_SIZE = 320  # pixels of a view, each way
_AWAY_M = 4.0  # of the camera from the middle of the tool
_ROOM = 1.1


class _View(NamedTuple):
    backward: tuple[float, float, float]  # from the tool to the camera
    right: int  # the axis to the right, and
    up: int


_VIEWS = {
    "front": _View((1.0, 0.0, 0.0), 1, 2),
    "side": _View((0.0, -1.0, 0.0), 0, 2),
    "top": _View((0.0, 0.0, 1.0), 0, 1),
}


def draw_tool(task: Task, simulator: Simulator, seed: int, tool: Tool) -> Image:
    """Draw a tool with components at home from the front, the side and above, in one picture (320, 960, 3).

    Raises:
        NoPicture: nothing here can draw.
    """
    corners = _tool_corners(task, tool)
    picture = Pillow.new("RGB", (3 * _SIZE, _SIZE))
    for number, (name, view) in enumerate(_VIEWS.items()):
        camera = _camera(view, corners.min(axis=0), corners.max(axis=0))
        drawn = Pillow.fromarray(simulator.render(task, seed=seed, tool=tool, camera=camera, width=_SIZE, height=_SIZE))
        pen = ImageDraw.Draw(drawn)
        pen.rectangle([(0, 0), (_SIZE, 17)], fill=(255, 255, 255))
        axes = f"{'xyz'[view.right]} right, {'xyz'[view.up]} up"
        pen.text(
            (4, 2), f"{name}: {axes}, {1000 * (camera.height_m or 0):.0f} mm high", fill=(30, 30, 30), font_size=13
        )
        picture.paste(drawn, (number * _SIZE, 0))
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


def _camera(view: _View, low: Array, high: Array) -> Camera:
    """Make a camera that shows the space from ``low`` to ``high``, (3,) each, in a square picture."""
    x, y, z = ((low + high) / 2 + _AWAY_M * np.array(view.backward)).tolist()
    target_x, target_y, target_z = ((low + high) / 2).tolist()
    shown = _ROOM * float(max((high - low)[[view.up, view.right]]))
    fov_deg = float(np.degrees(2 * np.arctan(shown / 2 / _AWAY_M)))  # for an engine without parallel projection
    return Camera((x, y, z), (target_x, target_y, target_z), fov_deg, shown)

"""Draw what was understood on one page: each photograph with the scene's outlines, the scene from there, and plans."""

from __future__ import annotations

import base64
import importlib.resources
from collections.abc import Mapping, Sequence
from typing import Any

import jinja2
import numpy as np
from scipy.spatial import ConvexHull

from core.errors import NoPicture
from core.geometry import Array, Pose
from core.interfaces import Simulator, Task
from core.simulation.pictures import png, report_missing
from plugins.tasks.file.bench.checks import SURROUNDINGS
from plugins.tasks.file.bench.fitting import list_corners
from plugins.tasks.file.bench.photographs import Photograph
from plugins.tasks.file.bench.scene_replies import Sighting

PLANS = {
    "plan: x to the right, y up": [0, 1],
    "elevation: x to the right, z up": [0, 2],
}
_MM = 1000
_TURNED_DEG = 0.5  # from where it is said


def draw_page(
    task: Task,
    photographs: Sequence[Photograph],
    sightings: Sequence[Sighting],
    simulator: Simulator,
    words: Sequence[str],
) -> str:
    """Draw the page, HTML without anything from elsewhere; what can't be drawn here is said."""
    bodies = dict[str, Array]()
    middles = dict[str, Array]()
    measures = dict[str, str]()
    for body in task.scene(0).bodies:
        if body.name not in SURROUNDINGS:
            corners = list_corners(body)
            low = corners.min(axis=0)
            high = corners.max(axis=0)
            bodies[body.name] = body.pose.apply(corners)
            middles[body.name] = body.pose.apply((low + high) / 2)
            measures[body.name] = _describe_measures(high - low, body.pose)

    panels = list[Mapping[str, Any]]()
    for number, photograph in enumerate(photographs, 1):
        drawn = None
        outlines = {}
        view = photograph.view
        if view is not None:
            for name, corners in bodies.items():
                outlines[name] = _outline(view.project(corners))

            try:
                drawn = _encode(png(simulator.render(task, camera=view.camera)))
            except NoPicture as error:
                report_missing("picture of the scene", error)

        panels.append(
            {
                "title": photograph.picture.caption,
                "size": photograph.size,
                "picture": _encode(photograph.picture.png),
                "points": [s.pixels for s in sightings if s.photo == number],
                "outlines": outlines,
                "drawn": drawn,
            }
        )

    plans = dict[str, Any]()
    for title, pair in PLANS.items():
        drawn_bodies = []
        for name, corners in bodies.items():
            outline = _outline(corners[:, pair] * [_MM, -_MM])
            x, y = middles[name][pair] * _MM
            label = f"{name}: {measures[name]} at ({x:.0f}, {y:.0f})"
            drawn_bodies.append({"outline": outline, "label": label})

        plans[title] = drawn_bodies

    file = (
        importlib.resources.files("plugins.tasks.file.bench") / "templates/page.html.j2"
    )
    template = jinja2.Environment(autoescape=True).from_string(file.read_text("utf-8"))
    return template.render(panels=panels, plans=plans, words=words, name=task.name)


def _describe_measures(size: Array, pose: Pose) -> str:
    """Say how large a body is along its own axes, m, and how far it is turned."""
    words = " x ".join(f"{length:.0f}" for length in size * _MM)
    roll, pitch, yaw = np.degrees(pose.rpy)
    if max(abs(roll), abs(pitch)) > _TURNED_DEG:
        return f"{words} mm, turned by rpy {roll:.0f}, {pitch:.0f}, {yaw:.0f} deg,"
    if abs(yaw) > _TURNED_DEG:
        return f"{words} mm, turned by {yaw:.0f} deg,"

    return f"{words} mm"


def _outline(corners: Array) -> list[list[float]]:
    """Return the hull of points (N, 2); what is seen from its edge is given some width."""
    hull = ConvexHull(corners, qhull_options="QJ")
    outline: list[list[float]] = np.round(corners[hull.vertices], 1).tolist()
    return outline


def _encode(picture: bytes) -> str:
    return base64.b64encode(picture).decode()

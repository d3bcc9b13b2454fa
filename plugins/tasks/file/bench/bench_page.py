"""Draw what was understood on one page: each photograph with the scene's outlines, the scene from there, and plans."""

from __future__ import annotations

import base64
import importlib.resources
from collections.abc import Sequence
from typing import Any, NamedTuple

import jinja2
import numpy as np
from scipy.spatial import ConvexHull

from core.errors import NoPicture
from core.geometry import Array
from core.interfaces import Simulator, Task
from core.scene import Body
from core.simulation.pictures import png, report_missing
from plugins.tasks.file.bench.checks import SURROUNDINGS
from plugins.tasks.file.bench.findings import Verdict
from plugins.tasks.file.bench.fitting import list_corners
from plugins.tasks.file.bench.photographs import Photograph
from plugins.tasks.file.bench.scene_replies import Sighting

PLANS = {"plan: x to the right, y up": 1, "elevation: x to the right, z up": 2}
"""What is drawn upwards: the number of an axis."""

_MM = 1000


class _Drawn(NamedTuple):
    """A body: its corners (N, 3) and its middle in the world, and its size along its own axes, metres."""

    body: Body
    corners: Array
    middle: Array
    size: Array


def draw_page(
    task: Task,
    photographs: Sequence[Photograph],
    sightings: Sequence[Sighting],
    simulator: Simulator,
    words: Sequence[str],
    verdicts: Sequence[Verdict] = (),
) -> str:
    """Draw the page, HTML without anything from elsewhere; what can't be drawn here is said."""
    bodies = []
    for body in task.scene(0).bodies:
        if body.name not in SURROUNDINGS:
            corners = list_corners(body)
            low = corners.min(axis=0)
            high = corners.max(axis=0)
            middle = body.pose.apply((low + high) / 2)
            bodies.append(_Drawn(body, body.pose.apply(corners), middle, high - low))

    rendered = {}
    for number, photograph in enumerate(photographs, 1):
        if photograph.view is not None:
            try:
                image = simulator.render(task, camera=photograph.view.camera)
                rendered[number] = png(image)
            except NoPicture as error:
                report_missing("picture of the scene", error)

    plans = dict[str, Any]()
    for title, up in PLANS.items():
        flat = [_outline(drawn.corners[:, [0, up]] * [_MM, -_MM]) for drawn in bodies]
        plans[title] = (up, list(zip(bodies, flat, strict=True)))

    folder = importlib.resources.files("plugins.tasks.file.bench") / "templates"
    environment = jinja2.Environment(autoescape=True)
    environment.filters |= {"outline": _outline, "base64": _encode, "deg": np.degrees}
    template = environment.from_string((folder / "page.html.j2").read_text("utf-8"))
    return template.render(
        name=task.name,
        words=words,
        verdicts=verdicts,
        photographs=photographs,
        sightings=sightings,
        bodies=bodies,
        rendered=rendered,
        plans=plans,
    )


def _outline(corners: Array) -> list[list[float]]:
    """Return the hull of points (N, 2); what is seen from its edge is given some width."""
    hull = ConvexHull(corners, qhull_options="QJ")
    outline: list[list[float]] = np.round(corners[hull.vertices], 1).tolist()
    return outline


def _encode(picture: bytes) -> str:
    return base64.b64encode(picture).decode()

"""Calibrated pictures: what is measured in them is where bodies are."""

import io
from functools import partial

import numpy as np
import pytest
from PIL import Image as Pillow
from scipy.ndimage import label

from core.design import Tool
from core.geometry import Box, Pose, Sphere
from core.plugins import installed
from core.scene import Body, Camera, Geom
from core.simulation.projection import project
from plugins.vlms.context.bodies_table import bounds
from plugins.vlms.context.calibrated_views import (
    SIZE,
    calibrated_pictures,
    parallel_camera,
)
from plugins.vlms.context.nearness import nearness
from tests.support.engines import simulator

pytestmark = pytest.mark.slow


def corner(pixels):
    """The first column and row of what is connected; the line to a name may cut it in two."""
    areas, _ = label(pixels)
    sizes = np.bincount(areas.ravel())[1:]
    large = 1 + np.flatnonzero(sizes > sizes.max() / 4)
    return np.argwhere(np.isin(areas, large)).min(axis=0)[::-1]


def test_a_cube_is_found_by_its_pixels_within_2_millimetres():
    """The left and the far edge of what is red, from those of what is blue, by the scale that the caption says."""
    task = installed().create("task", "BringCube", {"variation": "wide"})
    render = partial(simulator("mujoco").render, task, seed=5, tool=Tool())
    pictures = {p.name: p for p in calibrated_pictures(task, 5, render)}
    assert [*pictures] == ["scene", "close", "robot", "front", "side", "top"]
    scale_m = (
        float(pictures["top"].caption.split(" mm per pixel")[0].split()[-1]) / 1000
    )
    drawn = np.asarray(Pillow.open(io.BytesIO(pictures["top"].png))).astype(int)
    assert drawn.shape == (SIZE[1], SIZE[0], 3)
    red = (drawn[..., 0] > 120) & (drawn[..., 1] < 90) & (drawn[..., 2] < 90)
    blue = (drawn[..., 2] > 120) & (drawn[..., 0] < 90)
    apart = (corner(red) - corner(blue)) * [scale_m, -scale_m]
    edges = []
    for body in (task.scene(5)["cube"], task.scene(5)["mark"]):
        low, high = bounds(body, Pose())
        edges.append(body.pose.position[:2] + np.array([low[0], high[1]]))
    np.testing.assert_allclose(apart, edges[0] - edges[1], atol=0.002)


def test_no_name_covers_a_body_and_what_is_deeper_is_darker():
    """Names are the only white in pictures of gray; the door's slot is darker than its face."""
    task = installed().create("task", "OpenLatch")
    pictures = {p.name: p for p in calibrated_pictures(task, 0, gray)}
    front = np.asarray(Pillow.open(io.BytesIO(pictures["front"].png)).convert("L"))
    camera = parallel_camera("front", task.scene(0).bodies)
    per_m = SIZE[1] / camera.height_m
    x, y = project(camera, task.scene(0)["door"].pose.position, *SIZE).astype(int)
    slot = front[y + 5, x + 8]
    face = front[y + int(0.03 * per_m), x + 8]
    assert slot < 0.7 * face
    white = np.argwhere(front[20:-40, 60:] == 255)
    bodies = [task.scene(0)[name] for name in ("door", "cabinet")]
    covered = ~np.isnan(nearness(bodies, camera, *SIZE))
    rows, columns = white.T
    assert len(white) > 500
    assert not covered[rows + 20, columns + 60].any()


def gray(**view):
    return np.full((view["height"], view["width"], 3), 150, dtype=np.uint8)


def drawn(task, name):
    """Draw calibrated pictures of nothing, and return where one of them has lines, (H, W) of booleans."""
    made = calibrated_pictures(task, 0, blank)
    picture = next(picture for picture in made if picture.name == name)
    return np.asarray(Pillow.open(io.BytesIO(picture.png)).convert("L")) < 140


def blank(**view):
    return np.full((view["height"], view["width"], 3), 255, dtype=np.uint8)


@pytest.mark.parametrize(
    ("task", "name", "body", "size"),
    [
        pytest.param(  # in a pot with a lid
            *("LidAndBall", "front", "ball", (0.044, 0.044)), marks=pytest.mark.thorough
        ),
        pytest.param(  # clear, in a cupboard
            *("PastGlasses", "side", "glass_6", (0.048, 0.16)),
            marks=pytest.mark.thorough,
        ),
        ("OpenLatch", "front", "door", (0.06, 0.014)),  # its slot
    ],
)
def test_what_is_hidden_or_of_one_colour_has_edges(task, name, body, size):
    made = installed().create("task", task)
    camera = parallel_camera(name, made.scene(0).bodies)
    ink = drawn(made, name)
    x, y = project(camera, made.scene(0)[body].pose.position, *SIZE)
    per_m = SIZE[1] / camera.height_m
    for side, half in ((1, size[0] / 2), (0, size[1] / 2)):
        for sign in (-1, 1):
            at = np.array([y, x])
            at[side] += sign * half * per_m
            row, column = np.round(at).astype(int)
            assert ink[row - 2 : row + 3, column - 2 : column + 3].any(), (side, sign)


DOWN = Camera((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), 60.0, 0.75)  # 2.5 mm a pixel


def thing(shape, position, alpha=1.0):
    seen = (Geom(shape, color=(0.5, 0.5, 0.5, alpha)),)
    return Body("thing", Pose(np.array(position, dtype=float)), 0.0, seen, ())


def test_heights_are_those_of_the_highest_thing_that_is_not_clear():
    table = thing(Box((1.0, 0.5, 0.02)), (0, 0, -0.01))
    ball = thing(Sphere(0.1), (0.2, 0.1, 0.1))
    glass = thing(Box((0.1, 0.1, 0.3)), (0, 0, 0.15), alpha=0.3)
    found = nearness([table, ball, glass], DOWN, 400, 300)
    assert found[150 - 40, 200 + 80] == pytest.approx(0.2, abs=0.002)
    assert found[150 - 40, 200 + 80 + 24] == pytest.approx(
        0.1 + np.sqrt(0.1**2 - 0.06**2), abs=0.003
    )
    assert found[150, 200] == pytest.approx(0.0, abs=1e-9)
    assert np.isnan(found[10, 200])

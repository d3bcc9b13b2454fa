"""Views show bodies where their axes say, in every engine that can draw here."""

import numpy as np
import pytest
from scipy import ndimage

from core.design import Tool
from core.errors import NoPicture
from core.plugins import installed
from core.scene import Body, Box, Camera, floor, table
from core.simulation.views import _BOTTOM, _LEFT, _RIGHT, _TOP, _VIEWS, SIZE, _ticks, draw_view, view_camera
from plugins.conformance.worlds import Bodies
from tests.rare import rare

AT, SIDES = np.array([0.7, 0.25, 0.35]), np.array([0.16, 0.12, 0.08])
CUBE = Body.of("cube", Box(tuple(SIDES)), AT, mass=0.1, color=(0.0, 0.9, 0.1, 1.0))
TASK = Bodies(floor(), table(), CUBE)
INNER = SIZE[0] - _LEFT - _RIGHT, SIZE[1] - _TOP - _BOTTOM


def largest(mask):
    """The pixels of the largest patch; a name may lie across it."""
    patches, count = ndimage.label(ndimage.binary_closing(mask, iterations=2))
    sizes = ndimage.sum(mask, patches, range(1, count + 1))
    return np.nonzero(mask & (patches == 1 + np.argmax(sizes)))


def coordinates(name, pixels):
    """What a person reads from the axes at pixels (N, 2) of a view."""
    view, camera = _VIEWS[name], view_camera(TASK, name, 0)
    ticks = list(_ticks(camera, view, *INNER))
    read = []
    for axis, pixel, margin in ((view.right, pixels[:, 0], _LEFT), (view.up, pixels[:, 1], _TOP)):
        values, places = zip(*sorted((value, at + margin) for value, other, at in ticks if other == axis), strict=True)
        assert len(values) >= 5
        slope, start = np.polyfit(places, values, 1)
        read.append(slope * pixel + start)
    return np.array(read)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
@pytest.mark.parametrize("name", _VIEWS)
def test_a_body_is_where_the_axes_say(engine, name):
    try:
        picture = draw_view(TASK, installed().create("sim", engine), name, 0, Tool())
    except NoPicture as missing:
        pytest.skip(str(missing))
    assert picture.shape == (480, 640, 3)
    red, green, blue = picture.astype(int).transpose(2, 0, 1)
    rows, columns = largest((green > 2 * red) & (green > 2 * blue) & (green > 60))
    # Lines and the name may cover the rim, and pixels have a width.
    edges = np.array([[columns.min(), rows.max() + 1], [columns.max() + 1, rows.min()]])
    view = _VIEWS[name]
    low, high = (AT - SIDES / 2), (AT + SIDES / 2)
    metres_per_pixel = view_camera(TASK, name, 0).height_m / INNER[1]
    expected = np.array([[low[view.right], high[view.right]], [low[view.up], high[view.up]]])
    np.testing.assert_allclose(coordinates(name, edges), expected, atol=2.5 * metres_per_pixel)


@pytest.mark.slow
@pytest.mark.parametrize("engine", rare(["mujoco", "pybullet", "sapien"], "pybullet"))
def test_a_camera_projects_as_engines_do(engine):
    """With both projections in turn."""
    simulator, straight_down = installed().create("sim", engine), ((0.7, 0.2, 3.0), (0.7, 0.2, 0.0), 40.0)
    for camera in (Camera(*straight_down, 1.5), Camera(), Camera(height_m=1.2), Camera(*straight_down)):
        try:
            picture = simulator.render(TASK, tool=Tool(), camera=camera)
        except NoPicture as missing:
            pytest.skip(str(missing))
        check_projection(picture.astype(int), camera)


def check_projection(picture, camera):
    red, green, blue = picture.transpose(2, 0, 1)
    rows, columns = largest((green > 2 * red) & (green > 2 * blue) & (green > 60))
    signs = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    corners = camera.project(AT + signs * SIDES / 2, 640, 480)
    shown = np.array([[columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]])
    np.testing.assert_allclose(shown, [corners.min(axis=0), corners.max(axis=0)], atol=1.5)


class Blank:
    """Draws nothing, and notes what it was asked for."""

    def render(self, task, *, width, height, **view):
        self.asked = view
        return np.full((height, width, 3), 255, np.uint8)


@pytest.mark.parametrize("name", _VIEWS)
def test_every_body_but_the_floor_is_in_the_picture(name):
    blank = Blank()
    picture = draw_view(TASK, blank, name, 0, Tool())
    camera = blank.asked["camera"]
    signs = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    top = np.array([0.6, 0.0, -0.02]) + signs * [0.75, 0.5, 0.02]  # of the table
    pixels = camera.project(np.vstack([AT + signs * SIDES / 2, top, [[0.0, 0.0, 0.0]]]), *INNER)
    assert (pixels > 0).all()
    assert (pixels < INNER).all()
    assert (pixels.max(axis=0) - pixels.min(axis=0) > 0.7 * np.array(INNER)).any()  # and no farther away than needed
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 3  # axes, lines and the name


def test_an_engine_without_parallel_projection_shows_about_the_same():
    camera = view_camera(TASK, "side", 0)
    far = Camera(camera.position, camera.target, camera.fov_deg)
    corner = np.array([*camera.target[:2], 0.5])
    np.testing.assert_allclose(far.project(corner, 640, 480), camera.project(corner, 640, 480), atol=1e-6)


def test_the_task_s_camera_has_no_axes():
    blank = Blank()
    picture = draw_view(TASK, blank, "camera", 3, None)
    assert blank.asked == {"seed": 3, "tool": None}
    assert picture.shape == (480, 640, 3)
    assert (picture == 255).all()

"""Cameras project as engines draw, and views of a tool show all of it."""

import numpy as np
import pytest
from scipy import ndimage

from core.design import RIGID_MOUNT, Component, Tool
from core.errors import NoPicture
from core.geometry import Pose
from core.plugins import installed
from core.scene import Body, Box, Camera, floor, table
from core.simulation.pictures import draw_tool
from plugins.conformance.worlds import Bodies
from tests.rare import rare

AT, SIDES = np.array([0.7, 0.25, 0.35]), np.array([0.16, 0.12, 0.08])
CUBE = Body.of("cube", Box(tuple(SIDES)), AT, mass=0.1, color=(0.0, 0.9, 0.1, 1.0))
TASK = Bodies(floor(), table(), CUBE)


def largest(mask):
    """The pixels of the largest patch."""
    patches, count = ndimage.label(ndimage.binary_closing(mask, iterations=2))
    sizes = ndimage.sum(mask, patches, range(1, count + 1))
    return np.nonzero(mask & (patches == 1 + np.argmax(sizes)))


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
    """Draws nothing, and notes the cameras that it was asked for."""

    def __init__(self):
        self.cameras = []

    def render(self, task, *, camera, width, height, **view):
        self.cameras.append(camera)
        return np.full((height, width, 3), 255, np.uint8)


def test_all_of_a_tool_is_in_each_view_and_hardly_more():
    blank, task = Blank(), installed().create("task", "BringCube")
    tool = Tool((Component("rod", RIGID_MOUNT, Pose(np.array([0.0, 0.0, -0.1])), Box((0.02, 0.04, 0.2))),))
    assert draw_tool(task, blank, 0, tool).shape == (320, 960, 3)
    signs = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)])
    corners = task.home.position + [0.0, 0.0, -0.1] + signs * [0.01, 0.02, 0.1]
    for camera in blank.cameras:
        pixels = camera.project(corners, 320, 320)
        assert (pixels > 0).all()
        assert (pixels < 320).all()
        assert np.ptp(pixels, axis=0).max() > 0.85 * 320
        far = Camera(camera.position, camera.target, camera.fov_deg)  # an engine without parallel projection
        np.testing.assert_allclose(far.project(corners, 320, 320), pixels, atol=12)

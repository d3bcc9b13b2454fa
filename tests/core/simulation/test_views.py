"""Calibrated pictures: what is measured in them is where bodies are."""

import io

import numpy as np
import pytest
from PIL import Image as Pillow

from core.design import Tool
from core.plugins import installed
from core.simulation.views import SIZE, calibrated_pictures
from tests.engines import simulator

pytestmark = pytest.mark.slow


def test_a_cube_is_found_by_its_pixels_within_a_millimetre():
    """The middle of what is red in the view from above, by the scale that the caption says; the camera is centred."""
    task = installed().create("task", "BringCube", {"variation": "wide"})
    pictures = {p.name: p for p in calibrated_pictures(task, simulator("pybullet"), 5, Tool(), "pictures")}
    assert list(pictures) == ["scene", "close", "front", "side", "top"]
    scale_m = float(pictures["top"].caption.split(" mm per pixel")[0].split()[-1]) / 1000
    drawn = np.asarray(Pillow.open(io.BytesIO(pictures["top"].png))).astype(int)
    assert drawn.shape == (SIZE[1], SIZE[0], 3)
    cube, mark = (task.scene(5)[name].pose.position for name in ("cube", "mark"))
    red = (drawn[..., 0] > 120) & (drawn[..., 1] < 90) & (drawn[..., 2] < 90)
    blue = (drawn[..., 2] > 120) & (drawn[..., 0] < 90)
    places = [np.argwhere(color).mean(axis=0)[::-1] for color in (red, blue)]
    apart = (places[0] - places[1]) * [scale_m, -scale_m]
    np.testing.assert_allclose(apart, (cube - mark)[:2], atol=0.004)  # labels and axes cover some pixels


def test_photographs_have_no_scale_and_look_at_round_places():
    task = installed().create("task", "BringCube", {"variation": "wide"})
    one, other = calibrated_pictures(task, simulator("pybullet"), 5, Tool(), "photos")
    assert (one.name, other.name) == ("scene", "tripod")
    assert "focal length" in other.caption
    assert "mm per pixel" not in one.caption + other.caption
    target = other.caption.split("through (")[1].split(")")[0]
    assert all(round(float(x) / 0.05, 6).is_integer() for x in target.split(", "))

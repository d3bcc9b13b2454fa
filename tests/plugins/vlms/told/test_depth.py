"""Heights as a depth camera measures them."""

import numpy as np
import pytest

from core.config.compose import load
from core.geometry import Pose
from core.plugins import installed
from core.prompt import compose
from core.scene import Body, Box, Camera, Geom, Sphere
from core.simulation.pictures import nearness
from core.values.messages import Picture, Text
from plugins.vlms.told.depth import depth_picture, noise_m

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
    assert found[150 - 40, 200 + 80 + 24] == pytest.approx(0.1 + np.sqrt(0.1**2 - 0.06**2), abs=0.003)
    assert found[150, 200] == pytest.approx(0.0, abs=1e-9)
    assert np.isnan(found[10, 200])


def test_readings_have_the_noise_of_a_depth_camera_and_are_the_same_for_a_seed():
    task = installed().create("task", "BringCube")
    made = depth_picture(task, 0)
    lines = made.caption.split("\n")[2:]
    readings = np.array([line.split(": ")[1].split() for line in lines], dtype=float)
    table = readings[np.abs(readings) < 10]
    expected = 1000 * noise_m(np.array(1.0 + readings.max() / 1000))
    assert table.std() == pytest.approx(expected, rel=0.2)
    assert abs(table.mean()) < 0.5
    cube = task.scene(0)["cube"]
    assert readings.max() == pytest.approx(1000 * 2 * cube.pose.position[2], abs=8)
    assert depth_picture(task, 0) == made


def test_a_prompt_has_them_if_they_are_asked_for():
    def parts(*words):
        cfg = load("prompt", ["task=BringCube", "vlm=replay", "sim=mujoco", *words])
        return [part for message in compose(cfg).messages for part in message.parts]

    shown = parts("prompt.told=words", "prompt.depth=true")
    assert [part.name for part in shown if isinstance(part, Picture)][-1] == "depth"
    assert any(isinstance(part, Text) and "A reading in millimetres every" in part.text for part in shown)
    assert not any(isinstance(part, Picture) and part.name == "depth" for part in parts())

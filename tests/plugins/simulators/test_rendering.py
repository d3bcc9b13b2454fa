"""Test drawing with renderers that note their arguments; real ones are in the simulators' tests."""

import numpy as np
import pytest

from core.design import Tool
from core.errors import NoPicture
from core.interfaces import Simulator
from core.plugins import Offer, installed
from core.scene import Camera, floor, table
from plugins.conformance.worlds import HOME, Bodies, cube
from plugins.simulators.rendering import DrawingSimulator, Renderer
from tests.support.engines import simulator
from tests.support.panda import ARM, FINGER_OPEN, PANDA

HAND = Tool(gripper=True)  # without attachments
TASK = Bodies(table(), cube(at=(0.6, 0.0, 0.05)))


class BulkWorld(Renderer):
    name = "a pencil"

    def load(self, task, seed, tool):
        self.loaded = task, seed, tool

    def pose(self, joints, state):
        self.posed = joints, state

    def shoot(self, camera, width, height):
        self.shot = camera, width, height
        return np.zeros((height, width, 3), np.uint8)


class Painter(Simulator):
    def rollout(self, task, jobs):
        raise NotImplementedError

    def render(self, task, *, width=640, height=480, **view):
        return np.full((height, width, 3), 7, np.uint8)


@pytest.fixture
def painter(monkeypatch):
    offer = Offer("sim", "painter", "tests", "tests", Painter)
    monkeypatch.setattr(
        installed(), "offers", installed().offers | {("sim", "painter"): offer}
    )


class Pencilless(BulkWorld):
    def __init__(self):
        raise NoPicture("its own renderer needs a pencil")


def drawing(own, other):
    class Drawing(DrawingSimulator):
        renderer = own
        stand_in = other

        def rollout(self, task, jobs):
            raise NotImplementedError

    return Drawing()


def test_what_is_left_out_is_as_at_spawn():
    renderer = BulkWorld()
    assert renderer.render(TASK, width=4, height=3).shape == (3, 4, 3)
    joints, state = renderer.posed
    assert renderer.loaded == (TASK, 0, HAND)
    places = [*ARM.home_for(HOME), FINGER_OPEN, FINGER_OPEN]
    assert joints == dict(zip(PANDA.joints(True), places, strict=True))
    np.testing.assert_array_equal(state.position("cube"), [0.6, 0.0, 0.05])
    assert renderer.shot == (TASK.camera, 8, 6)


def test_what_is_given_is_shown():
    renderer = BulkWorld()
    camera = Camera(position=(1.0, 1.0, 1.0))
    state = TASK.scene(0).state()
    renderer.render(
        TASK, seed=3, arm=np.ones(7), fingers=np.zeros(2), state=state, camera=camera
    )
    assert renderer.loaded == (TASK, 3, HAND)
    assert [*renderer.posed[0].values()] == [1.0] * 7 + [0.0] * 2
    assert renderer.posed[1] is state
    assert renderer.shot == (camera, 1280, 960)


def test_its_own_renderer_comes_first(painter):
    pictures = drawing(BulkWorld, "painter")
    assert pictures.render(TASK, width=4, height=3).max() == 0
    assert pictures.drawn_by == "a pencil"


def test_another_simulator_stands_in(painter):
    pictures = drawing(Pencilless, "painter")
    assert pictures.render(TASK, width=4, height=3).min() == 7
    assert pictures.drawn_by == "painter's renderer: its own renderer needs a pencil"


def test_with_neither_both_reasons_are_said():
    with pytest.raises(
        NoPicture,
        match=r"needs a pencil, and missing's can't stand in for it: no sim 'missing'",
    ):
        drawing(Pencilless, "missing").render(TASK)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
def test_ground_far_from_the_table_is_plain(engine):
    """Nothing shades it but the table and the arm, which stand at the picture's other end."""
    task = Bodies(floor(), cube(at=(0.6, 0.0, 0.05)))
    far = Camera(position=(0.5, -4.0, 1.2), target=(0.4, 0.0, 0.0))
    ground = simulator(engine).render(task, camera=far, width=320, height=240)[180:]
    assert ground.std(axis=(0, 1)).max() < 3

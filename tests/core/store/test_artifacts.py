import numpy as np
import pytest
from PIL import Image

from core.design import Candidate, Component, Tool
from core.geometry import Box, Pose
from core.interfaces import RolloutSettings
from core.plugins import installed
from core.simulation.pictures import FILM_HZ, png, save_film
from core.store.artifacts import tool_mesh


def box(name, parent, at, size, rpy=(0, 0, 0)):
    return Component(name, parent, Pose.xyz_rpy(at, rpy), Box(size))


def test_a_tool_is_printed_in_millimetres():
    tool = Tool(
        (
            box("shaft", "panda_virtual", (0, 0, -0.05), (0.02, 0.02, 0.1)),
            box("blade", "shaft", (0.06, 0, 0), (0.1, 0.02, 0.02), (0, np.pi / 2, 0)),
        )
    )
    mesh = tool_mesh(tool)
    np.testing.assert_allclose(mesh.bounds, [[-10, -10, -100], [70, 10, 0]], atol=1e-6)
    assert mesh.volume == pytest.approx(1e9 * (0.02 * 0.02 * 0.1 + 0.1 * 0.02 * 0.02))


def test_a_pair_of_attachments_is_printed_side_by_side():
    fingers = ("panda_leftfinger", 1), ("panda_rightfinger", -1)
    pads = (box(f"pad_{mount}", mount, (0, side * 0.0075, 0.07), (0.02, 0.015, 0.04)) for mount, side in fingers)
    mesh = tool_mesh(Tool(tuple(pads), gripper=True))
    np.testing.assert_allclose(mesh.bounds, [[-10, -55, 50], [10, 55, 90]], atol=1e-6)
    assert mesh.body_count == 2


def test_pictures_are_png():
    picture = np.arange(36, dtype=np.uint8).reshape(3, 4, 3)
    assert png(picture).startswith(b"\x89PNG")


def test_a_film_lasts_as_long_as_the_rollout(tmp_path):
    task, simulator = installed().create("task", "BringCube"), installed().create("sim", "pybullet")
    short = RolloutSettings(segment_s=0.3, settle_s=0.1, hold_s=0.2)
    candidate = Candidate(Tool(), np.array([[0.5, 0, 0.45, 0, 0, 0.0]]))
    save_film(task, simulator, candidate, 0, short, tmp_path / "film.gif")
    film = Image.open(tmp_path / "film.gif")
    durations = []
    for frame in range(film.n_frames):
        film.seek(frame)
        durations.append(film.info["duration"])
    assert sum(durations) / 1000 == pytest.approx(0.6 + 0.2, abs=0.2)  # the last frame stays for its own time
    assert 0 < film.n_frames <= 0.8 * FILM_HZ + 2

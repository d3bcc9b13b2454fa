"""Answers that were written by hand from two photographs alone, of tasks whose truth is known.

The photographs were drawn with noise and blur. Half of them were taken 1 cm and 1 degree off the pose that is stated.
"""

from pathlib import Path

import numpy as np
import pytest
import yaml

from core.interfaces import Picture
from core.scene import Camera
from plugins.tasks.file.bench.board import find_by_board
from plugins.tasks.file.bench.drafts import Draft
from plugins.tasks.file.bench.photographs import Photograph, read_photographs
from plugins.tasks.file.bench.scene_command import main
from plugins.tasks.file.bench.scene_replies import read_reply
from plugins.tasks.file.bench.views import CameraError, View
from tests.support.panda import on_panda
from tests.support.scene_files import true_task

HERE = Path(__file__).parent
SIZE = (1280, 960)
CAMERAS = yaml.safe_load((HERE / "cameras.yaml").read_text())
NAMES = CAMERAS["names"]
PLACES = CAMERAS["as_stated"] | CAMERAS["shifted"]
# Of cameras that stand where they are said to.
MEASURED = CameraError(place_m=0.001, turn_deg=0.1, fov_deg=0.1, bend=0.001)
# By how much middles and sizes of bodies are off at most, m.
EXACT = (0.006, 0.018)
OFF = (0.03, 0.035)
CAMERA = View(Camera((1.4, -0.9, 0.9), (0.6, 0.0, 0.1), 52.0), SIZE, roll=0.1)
QUICK = ("BringCube", "MoveBall")


def examine(folder, name, reply, error=MEASURED):
    """Examine an answer to a task's photographs."""
    cameras = [Camera(tuple(place), (0.65, 0.0, 0.1), 52.0) for place in PLACES[name]]
    views = [View(camera, SIZE) for camera in cameras]
    photographs = [Photograph(Picture(b""), SIZE, view, error=error) for view in views]
    robot = on_panda(true_task(name)).robot
    draft = Draft(folder / "scene.yaml", photographs, {}, robot, 52.0)
    text = (HERE / f"replies/{reply}.md").read_text()
    draft.text, draft.beside = read_reply(draft.file, text)
    draft.examine()
    return draft


def box_of(body):
    """The middle of a body's box in the world, and its size."""
    corners = [
        (body.pose @ geom.pose).apply(geom.shape.to_trimesh().vertices)
        for geom in body.collisions or body.visuals
    ]
    low = np.concatenate(corners).min(axis=0)
    high = np.concatenate(corners).max(axis=0)
    return (low + high) / 2, high - low


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in QUICK else pytest.mark.thorough)
        for name in PLACES
    ],
)
def test_bodies_stand_where_they_do_in_truth(tmp_path, name):
    error = CameraError() if name in CAMERAS["shifted"] else MEASURED
    draft = examine(tmp_path, name, name, error)
    assert draft.faults == []
    most_off, most_wrong = OFF if name in CAMERAS["shifted"] else EXACT
    scene = draft.read().scene(0)
    true = true_task(name).scene(0)
    known = {body.name: body for body in true.bodies}
    compared = 0
    for body in scene.bodies[2:]:
        truth = known.get(NAMES.get(body.name, body.name))
        # Boards are other bodies there, what lies inside was assumed, and glasses were counted from the other side.
        if truth is None or body.name in ("board", "ball") or "glass" in body.name:
            continue
        middle, size = box_of(body)
        true_middle, true_size = box_of(truth)
        assert np.abs(middle - true_middle).max() < most_off, body.name
        assert np.abs(size - true_size).max() < most_wrong, body.name
        compared += 1
    assert compared >= 1


@pytest.mark.thorough
def test_a_point_that_was_guessed_is_a_fault(tmp_path):
    draft = examine(tmp_path, "LidAndBall", "LidAndBall_first")
    assert [fault.split(", seen")[0] for fault in draft.faults] == ["pot", "pot"]


def test_a_camera_is_found_by_the_printed_board(tmp_path, capsys):
    cv2 = pytest.importorskip("cv2")
    main([f"print_board={tmp_path}/board.png"])
    sheet = cv2.resize(cv2.imread(f"{tmp_path}/board.png"), (210, 297), interpolation=3)
    # Its middle lies at (0.5, -0.2), and it is turned to the left by 90 degrees.
    edges = np.float32([[0, 0], [210, 0], [0, 297], [210, 297]])
    corners = [[x, y, 0] for y in (-0.0515, -0.3485) for x in (0.395, 0.605)]
    seen = np.float32(CAMERA.project(np.array(corners)))
    warp = cv2.getPerspectiveTransform(edges, seen)
    cv2.imwrite(f"{tmp_path}/photo.png", cv2.warpPerspective(sheet, warp, SIZE))
    photographs = read_photographs([f"{tmp_path}/photo.png"], [])
    (found,) = find_by_board(photographs, (0.5, -0.2, 90), 52.0)
    assert "at yaw 0 its edge with the words is away" in capsys.readouterr().out
    off = np.array(found.view.camera.position) - CAMERA.camera.position
    assert np.linalg.norm(off) < 0.015
    assert found.view.roll == pytest.approx(CAMERA.roll, abs=0.01)

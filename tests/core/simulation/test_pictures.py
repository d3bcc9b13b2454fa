import io
import threading
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from core.design import Candidate, Tool
from core.interfaces import RolloutSettings
from core.plugins import Offer, installed
from core.scene import Body, Box, Camera, table
from core.search.experiment import Experiment
from core.search.orchestration import resume, run
from core.simulation.closing import fly
from core.simulation.pictures import (
    CLOSING_S,
    FILM_HZ,
    LABEL_S,
    SMALL,
    STAY_MS,
    filmed,
    png,
    save_film,
)
from plugins.actions.anchored import AnchoredActions
from plugins.conformance.sample_tools import stick
from plugins.conformance.worlds import Bodies, cube
from tests.support import toys
from tests.support.engines import SIMULATORS, mujoco_first, simulator
from tests.support.rare import rare


def test_a_png_holds_the_picture_as_it_is():
    picture = np.arange(36, dtype=np.uint8).reshape(3, 4, 3)
    np.testing.assert_array_equal(Image.open(io.BytesIO(png(picture))), picture)


def test_a_film_shows_the_motion_and_lasts_as_long(tmp_path):
    task, engine = (
        installed().create("task", "BringCube"),
        installed().create("sim", "pybullet"),
    )
    short = RolloutSettings(segment_s=0.3, settle_s=0.1, hold_s=0.2)
    candidate = Candidate(Tool(), np.array([[0.5, 0, 0.45, 0, 0, 0.0]]))
    save_film(filmed(task, engine, candidate, 0, short, SMALL), tmp_path / "film.gif")
    film = Image.open(tmp_path / "film.gif")
    durations, frames = [], []
    for frame in range(film.n_frames):
        film.seek(frame)
        durations.append(film.info["duration"])
        frames.append(np.asarray(film.convert("RGB")).astype(int))
    # The last frame stays for its own time, and before it the camera flies to the cube.
    lasts = 0.6 + 0.2 + CLOSING_S + STAY_MS / 1000
    assert sum(durations) / 1000 == pytest.approx(lasts, abs=0.3)
    assert 0 < film.n_frames <= (0.8 + CLOSING_S) * FILM_HZ + 3
    at_home = engine.render(task, tool=Tool(), width=SMALL[0], height=SMALL[1])
    # Of 255; a film has 96 colours.
    differ = [(np.abs(frame - at_home).max(axis=-1) > 30).mean() for frame in frames]
    moved = film.n_frames - round(CLOSING_S * FILM_HZ) - 1
    assert differ[0] < 0.002
    assert 0.002 < differ[moved] < 0.2  # the hand has moved
    assert differ[-1] > 0.3  # it is another view


@pytest.mark.thorough
def test_a_film_says_what_a_look_saw():
    task = installed().create("task", "BringCube")
    engine = installed().create("sim", "pybullet")
    short = RolloutSettings(settle_s=0.1, hold_s=2.0)
    there = {"offset": [0.5, 0.0, 0.45], "seconds": 0.5}
    plan = AnchoredActions().parse([there, {"look": True}, there], gripper=False)
    film = filmed(task, engine, Candidate(Tool(), plan), 0, short, SMALL)
    (look,) = film.happened

    labelled = {}
    count = len(film.recording.times)
    for number, (shown, _) in zip(range(count), film.frames(), strict=False):
        same = np.array_equal(shown, film.draw(number))
        labelled[round(float(film.recording.times[number] - look.at_s), 3)] = not same
    assert "cube not in place" in str(look)
    for since, has_label in labelled.items():
        assert has_label == (0 <= since < LABEL_S)
    assert {*labelled.values()} == {True, False}


def count_red(picture):
    red = picture[..., 0] > 120
    return int((red & (picture[..., 1] < 80) & (picture[..., 2] < 80)).sum())


def test_a_film_ends_where_the_body_of_the_goal_is_not_hidden():
    """A wall stands between the task's camera and the cube."""
    task = installed().create("task", "BringCube")
    engine = installed().create("sim", "pybullet")
    place = task.scene(0).state().position("cube")
    away = np.array(task.camera.position) - place
    middle = place + 0.12 * away / np.linalg.norm(away) * (1, 1, 0)
    gray = (0.5, 0.5, 0.5, 1.0)
    wall = Body.of("wall", Box((0.15, 0.15, 0.5)), tuple(middle), mass=0.0, color=gray)

    class Hidden(type(task)):
        def scene(self, seed):
            whole = super().scene(seed)
            return replace(whole, bodies=(*whole.bodies, wall))

    hidden = Hidden()
    hidden.robot = task.robot
    short = RolloutSettings(segment_s=0.1, settle_s=0.1, hold_s=0.1)
    candidate = Candidate(Tool(), np.array([[0.5, 0, 0.45, 0, 0, 0.0]]))
    film = filmed(hidden, engine, candidate, 0, short, SMALL)
    closing = film.find_closing()

    assert count_red(film.draw(0)) < 10
    assert count_red(film.draw(0, lambda _: closing)) > 100


def test_the_camera_goes_straight_and_ends_where_it_should():
    before = Camera((1.0, 0.1, 1.0), (0.0, 0.0, 0.0), 60.0)
    after = Camera((-1.0, 0.1, 0.5), (0.2, 0.1, 0.0), 40.0)
    on_the_way = fly(before, after, 0.5)
    assert on_the_way.position == pytest.approx((0.0, 0.1, 0.75))
    assert on_the_way.fov_deg == pytest.approx(50.0)
    for share, camera in ((0.0, before), (1.0, after)):
        there = fly(before, after, share)
        assert there.position == pytest.approx(camera.position)
        assert there.target == pytest.approx(camera.target)


@pytest.mark.thorough
@pytest.mark.slow
@mujoco_first
def test_every_thread_draws_the_same(engine):
    task, pictures = Bodies(table(), cube(at=(0.6, 0.0, 0.05))), []

    def draw():
        for tool in (None, stick(0.25)):  # each is loaded anew
            pictures.append(
                simulator(engine).render(task, tool=tool, width=32, height=24)
            )

    draw()
    for _ in range(3):
        thread = threading.Thread(target=draw)
        thread.start()
        thread.join()
    draw()
    assert len(pictures) == 10
    assert (pictures[0] != pictures[1]).any()
    for number, picture in enumerate(pictures):
        np.testing.assert_array_equal(picture, pictures[number % 2])


def open_picture(file):
    with Image.open(file) as picture:
        return np.asarray(picture.convert("L")).astype(int)


@pytest.mark.thorough
@pytest.mark.parametrize("engine", rare(SIMULATORS, "mujoco", mark="weekly"))
def test_a_run_shows_its_best_elite_and_so_does_one_that_goes_on(engine, tmp_path):
    """The scene is drawn in the main thread, elites in the one that reads candidates."""
    simulator(engine)
    words = [
        "budget=tiny",
        "budget.n_iteration=1",
    ]
    words += [
        "budget.reward_save=-1",
        "prompt.feedback=full",
        "executor.workers=1",
        "listener=[]",
        "film=false",
    ]
    Experiment(*words, task="BringCube", sim=engine).run(tmp_path)
    resume(tmp_path, ["budget.n_iteration=2"])
    scene = open_picture(tmp_path / "scene.png")
    elites = sorted((tmp_path / "requests").glob("strip_*.png"))
    assert elites[0].name.startswith("strip_g0-")
    assert scene.shape == (480, 640)
    for file in elites:
        strip = open_picture(file)
        assert strip.shape == (720, 1440)
        # The first frame and the last one of two rows of three, below their captions.
        halves = strip[20:360, :480], strip[380:, 960:]
        # Neither blank nor of one colour.
        assert all(half.std() > 10 for half in halves)
        assert (halves[0] != halves[1]).mean() > 0.001  # something has moved
    assert "strip_g0" in (tmp_path / "requests" / "g1-a0.md").read_text()
    assert "strip_g" in (tmp_path / "requests" / "g2-a0.md").read_text()


class Shaky(toys.ToyEngine):
    """Its renderer breaks after ``whole`` pictures."""

    def __init__(self, whole):
        self.whole = whole

    def render(self, task, **view):
        self.whole -= 1
        if self.whole < 0:
            raise RuntimeError("the driver\nis gone")
        return super().render(task, **view)


@pytest.mark.parametrize("whole", [0, 1])
def test_a_picture_that_fails_costs_the_picture_and_not_the_run(
    whole, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(installed(), "offers", dict(installed().offers))
    toys.offer(installed())
    installed().offers["sim", "shaky"] = Offer("sim", "shaky", "toys", "tests", Shaky)
    cfg = toys.config(tmp_path / "notes", "prompt.feedback=full")
    cfg.sim, cfg.film = {"name": "shaky", "whole": whole}, True
    result = run(cfg, tmp_path / "run")
    assert len(result.generations) == 2
    assert result.best.reward > 0
    said = capsys.readouterr().err.splitlines()
    missing = [line for line in said if line.startswith("no ")]
    assert missing[0].startswith(
        "no film strip of g0-"
        if whole
        else "no picture of the scene: the driver is gone"
    )
    assert missing[-1].startswith("no film: ")
    assert (tmp_path / "run" / "scene.png").exists() == bool(whole)
    assert not (tmp_path / "run" / "best" / "rollout.gif").exists()

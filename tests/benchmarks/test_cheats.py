"""The search for cheats draws designs that a run would read, measures what is absurd, and gives the same again."""

import json
import sys
from dataclasses import replace

import numpy as np
import pytest

from core.design import RIGID_MOUNT, Candidate, Component, Tool, ToolJoint
from core.errors import UsageError
from core.geometry import Box, Pose, Sphere
from core.interfaces import Recording
from core.plugins import installed
from core.robot.trajectory import at_home
from core.scene import Elastic, Filling, Region, Scene, Soft, State
from plugins.conformance.evaluations import tried_once
from tests.benchmarks import absurd, cheats
from tests.support.solutions import anchored

SOFT = Elastic(150, 20000)


def component(name, size, at, parent=RIGID_MOUNT, mass=0.1):
    return Component(name, parent, Pose(np.array(at)), Box(size), mass)


def moved(position, x, z):
    return np.array([position[0] + x, position[1], position[2] + z])


def recording(task, positions):
    """The arm stays at home, and the free bodies are at ``positions`` from the second of four samples on."""
    start = task.scene(0).state()
    trajectory = at_home(task)
    states = [start] + [
        replace(start, positions=np.array(positions, dtype=np.float64))
    ] * 3
    arm = np.repeat(trajectory.arm, 4, axis=0)
    fingers = np.full((4, 2), 0.04)
    return Recording(np.arange(4) / 25, arm, fingers, State.stack(states))


@pytest.fixture
def task():
    return installed().create("task", "BringCube")


def test_a_sheet_is_inside_of_a_cube_by_its_area(task):
    scene = task.scene(0)
    tool = Tool((component("sheet", (0.2, 0.2, 0.001), (0.0, 0.0, -0.05)),))
    at = moved(task.home.position, 0.0, -0.05)
    area, where = absurd.inside(scene, tool, recording(task, [at]))
    assert area == pytest.approx((7 - 2 * 0.3) ** 2, rel=0.15)
    assert where == "sheet in cube at 0.04 s"
    # 1 mm deep: engines are soft.
    assert absurd.inside(scene, tool, recording(task, [moved(at, 0.0, 0.034)]))[0] == 0
    plate = installed().create("task", "ElevatePlate")
    seam = moved(at, 0.0, -0.018)  # between its foot and its disc, which touch
    assert absurd.inside(plate.scene(0), tool, recording(plate, [seam]))[0] > 50


def test_parts_that_come_away_are_seen(task):
    hinge = ToolJoint("hinge", (0.0, 1.0, 0.0), 0.0, 1.0)
    post = component("post", (0.02, 0.02, 0.2), (0.0, 0.0, -0.1))
    for gap, lack in ((0.0, 1.0), (0.0025, 0.5), (0.02, 0.0)):
        arm = replace(
            component("arm", (0.02, 0.02, 0.1), (0.0, 0.0, -0.15 - gap), "post"),
            joint=hinge,
        )
        tool = Tool((post, arm))
        seen = recording(task, [moved(task.scene(0)["cube"].pose.position, gap, 0.0)])
        seen = replace(seen, fingers=np.pad(seen.fingers, ((0, 0), (0, 1))))
        evaluation = tried_once(Candidate(tool, np.zeros((1, 6))), "ok")
        tried = absurd.Tried(task.scene(0), evaluation, seen, [], [])
        assert absurd.parted(tried) == pytest.approx(lack, abs=0.01)


def test_a_tool_far_from_all_is_idle_and_one_beside_a_body_is_not(task):
    tool = Tool((component("post", (0.02, 0.02, 0.2), (0.0, 0.0, -0.1)),))
    evaluation = tried_once(Candidate(tool, np.zeros((1, 6))), "ok")
    for shift, lack in ((-0.3, 0.0), (-0.1, 0.16)):  # 2 of 25 a second, of 0.5 s
        seen = recording(task, [moved(task.home.position, 0.0, shift)])
        tried = absurd.Tried(task.scene(0), evaluation, seen, [], [])
        assert absurd.idle(tried) == pytest.approx(lack, abs=0.1)


def test_a_tool_in_a_soft_ball_is_sunk_by_its_depth(task):
    tool = Tool((component("post", (0.02, 0.02, 0.2), (0.0, 0.0, -0.1)),))
    tip = np.array(task.home.position) - [0.0, 0.0, 0.2]
    form = Filling(Sphere(0.05))
    evaluation = tried_once(Candidate(tool, np.zeros((1, 6))), "ok")
    for deep, lack in ((-0.01, 1.0), (0.04, 0.0)):
        at = tip - [0.0, 0.0, 0.05 - deep]
        soft = Soft.make("soft", form, SOFT, Pose(at), color=(1, 1, 1, 1))
        seen = recording(task, [task.scene(0)["cube"].pose.position])
        nodes = np.repeat((form.nodes + at)[None], len(seen.times), axis=0)
        seen = replace(seen, states=replace(seen.states, soft={"soft": nodes}))
        tried = absurd.Tried(Scene((soft,)), evaluation, seen, [], [])
        assert absurd.sunk(tried) == lack


def test_a_fixture_is_drawn_where_it_may_stand():
    region = Region(np.array([0.4, -0.2, 0.1]), np.array([0.8, 0.2, 0.5]))
    varied = cheats.Varied(["world"], np.random.default_rng(0), region)
    tool = Tool((component("post", (0.02, 0.02, 0.2), (0.0, 0.0, -0.1)),))
    for _ in range(5):
        fixture = varied.fixture(region)
        foot = fixture.parts.components[0]
        middle = fixture.pose.position + foot.pose.position
        assert region.holds(middle, np.array(foot.shape.size) / 2)
        grown = replace(tool, fixture=fixture)
        changed = [varied.changed_fixture(grown, region) for _ in range(5)]
        assert any(other != fixture for other in changed)


@pytest.fixture
def search(tmp_path):
    return cheats._Search(
        cheats.Pair(
            "LeverStone",
            "pressed",
            cheats.engines(["mujoco"])["mujoco"],
            0,
            10,
            tmp_path,
        )
    )


@pytest.mark.thorough
def test_the_reference_solution_is_not_absurd(search):
    measures = dict(absurd.MEASURES)
    measures.pop("anything")  # it lets all that earns be looked at
    for name, measure in measures.items():
        search.measure = measure
        ((evaluation, lack),) = search.tried([anchored("LeverStone")])
        assert evaluation.reward > 0.9
        assert lack > 0, name


@pytest.mark.thorough
def test_a_small_search_gives_the_same_again(tmp_path, monkeypatch):
    monkeypatch.setattr(cheats, "FOUND", -1.0)
    words = [
        "tasks=LeverStone",
        "measures=still",
        "sim=mujoco",
        "rollouts=40",
        "workers=1",
    ]
    said = []
    for folder in ("one", "two"):
        monkeypatch.setattr(sys, "argv", ["", f"folder={tmp_path / folder}", *words])
        cheats.main()
        record = json.loads(
            (tmp_path / folder / "searched/LeverStone.still.0.json").read_text()
        )
        said.append({key: value for key, value in record.items() if key != "seconds"})
    assert said[0] == said[1]
    assert said[0]["absurd"] > 30
    assert np.isclose(said[0]["best"], 0.0)


def test_mistakes(monkeypatch):
    for words in (["measures=unknown"], ["wrong=1"]):
        monkeypatch.setattr(sys, "argv", ["", *words])
        with pytest.raises(UsageError):
            cheats.main()

"""The search's measures of absurdity know what is absurd, and a small search runs to its table."""

import sys
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("cmaes")

from core.design import RIGID_MOUNT, Candidate, Component, Evaluation, Tool, ToolJoint
from core.errors import UsageError
from core.geometry import Box, Pose
from core.interfaces import Recording
from core.plugins import installed
from core.robot.trajectory import at_home
from core.scene import State
from tests.benchmarks import absurd, adversary


def component(name, size, at, parent=RIGID_MOUNT, mass=0.1):
    return Component(name, parent, Pose(np.array(at)), Box(size), mass)


def moved(position, x, z):
    return np.array([position[0] + x, position[1], position[2] + z])


def recording(task, positions):
    """The arm stays at home, and the free bodies are at ``positions`` from the second of four samples on."""
    start, trajectory = task.scene(0).state(), at_home(task)
    states = [start] + [replace(start, positions=np.array(positions, dtype=np.float64))] * 3
    arm, fingers = np.repeat(trajectory.arm, 4, axis=0), np.full((4, 2), 0.04)
    return Recording(np.arange(4) / 25, arm, fingers, State.stack(states))


@pytest.fixture
def task():
    return installed().create("task", "BringCube")


def test_a_body_hangs_where_nothing_is_below_its_middle(task):
    scene, tool = task.scene(0), Tool((component("board", (0.3, 0.1, 0.02), (0.0, 0.0, -0.01)),))
    top = moved(task.home.position, 0.0, 0.035)  # the board's upper side, and half a cube
    for x, beyond in ((0.05, 0.0), (0.17, 0.02), (0.6, 1.0)):
        found, name = absurd.hanging(scene, tool, recording(task, [moved(top, x, 0.0)]))
        assert found == pytest.approx(beyond, abs=1e-3)
        assert name == ("cube" if beyond else "")
    falling = recording(task, [moved(top, 0.6, 0.0)])
    falling.states.linear_velocities[-1, 0, 2] = -1.0
    assert absurd.hanging(scene, tool, falling)[0] == 0


def test_a_sheet_is_inside_of_a_cube_by_its_area(task):
    scene, tool = task.scene(0), Tool((component("sheet", (0.2, 0.2, 0.001), (0.0, 0.0, -0.05)),))
    at = moved(task.home.position, 0.0, -0.05)
    area, where = absurd.inside(scene, tool, recording(task, [at]))
    assert area == pytest.approx((7 - 2 * 0.3) ** 2, rel=0.15)
    assert where == "sheet in cube at 0.04 s"
    assert absurd.inside(scene, tool, recording(task, [moved(at, 0.0, 0.034)]))[0] == 0  # 1 mm deep: engines are soft
    plate = installed().create("task", "ElevatePlate")
    seam = moved(at, 0.0, -0.018)  # between its foot and its disc, which touch
    assert absurd.inside(plate.scene(0), tool, recording(plate, [seam]))[0] > 50


def test_bodies_that_move_before_the_motion_and_parts_that_come_away_are_seen(task):
    hinge = ToolJoint("hinge", (0.0, 1.0, 0.0), 0.0, 1.0)
    post = component("post", (0.02, 0.02, 0.2), (0.0, 0.0, -0.1))
    for gap, lack in ((0.0, 1.0), (0.0025, 0.5), (0.02, 0.0)):
        arm = replace(component("arm", (0.02, 0.02, 0.1), (0.0, 0.0, -0.15 - gap), "post"), joint=hinge)
        tool = Tool((post, arm))
        seen = recording(task, [moved(task.scene(0)["cube"].pose.position, gap, 0.0)])
        seen = replace(seen, fingers=np.pad(seen.fingers, ((0, 0), (0, 1))))
        evaluation = Evaluation(Candidate(tool, np.zeros((1, 6))), "ok")
        for times, lacks in ((seen.times, 1.0), (seen.times - 0.08, lack)):
            tried = absurd.Tried(task.scene(0), evaluation, replace(seen, times=times), [], [])
            assert absurd.early(tried) == pytest.approx(lacks, abs=0.01)
            assert absurd.parted(tried) == pytest.approx(lack, abs=0.01)


def test_a_bent_tool_stays_joined_and_becomes_absurd():
    random = np.random.default_rng(0)
    parts = (
        component("post", (0.02, 0.02, 0.3), (0.0, 0.0, -0.15)),
        component("sheet", (0.2, 0.1, 0.02), (0.1, 0.0, -0.14), "post"),
    )
    start = absurd.Start(Tool(parts), np.zeros((3, 6)))
    same = start.bent(np.zeros(start.size), lambda tool: tool)
    assert all(np.allclose(a.pose.matrix, b.pose.matrix) for a, b in zip(same.tool.components, parts, strict=True))
    for name, (least, mass) in {"gram": (1.0, 0.0011), "sheet": (0.001, 9.9), "inside": (0.002, 9.9)}.items():
        for _ in range(20):
            bent = start.bent(random.normal(size=start.size), absurd.OBJECTIVES[name].shape)
            assert bent.tool.mass < mass
            assert all(min(part.shape.size) <= least for part in bent.tool.components)
            joint = bent.tool.components[1].pose
            reach = np.linalg.norm(bent.tool.components[0].shape.size) + np.linalg.norm(
                bent.tool.components[1].shape.size
            )
            assert np.linalg.norm(joint.position) < reach / 2


@pytest.mark.slow
@pytest.mark.thorough
def test_a_small_search_is_written_once_and_gives_the_same_again(tmp_path, monkeypatch, capsys):
    words = ["tasks=BringCube", "objectives=gram", "sims=mujoco", "rollouts=60", "workers=1"]
    results = []
    for folder in (tmp_path / "one", tmp_path / "one", tmp_path / "two"):
        monkeypatch.setattr(sys, "argv", ["", "search", f"folder={folder}", *words])
        adversary.main()
        file = folder / "searched" / "BringCube.gram.0.json"
        results.append((file.stat().st_ino, [word for word in file.read_text().split("\n") if "seconds" not in word]))
        assert "| BringCube |" in capsys.readouterr().out
    assert results[0] == results[1]
    assert results[0][1] == results[2][1]
    found = tmp_path / "one" / "findings" / "BringCube.gram.0.json"
    assert found.exists()
    monkeypatch.setattr(sys, "argv", ["", "judge", f"folder={tmp_path / 'one'}", *words])
    adversary.main()
    assert "BringCube.gram.0.0" in capsys.readouterr().out
    assert (tmp_path / "one" / "strips" / "BringCube.gram.0.0.png").stat().st_size > 10_000


def test_mistakes(monkeypatch):
    for words in ([], ["find"], ["search", "objectives=unknown"], ["search", "wrong=1"]):
        monkeypatch.setattr(sys, "argv", ["", *words])
        with pytest.raises(UsageError):
            adversary.main()


def test_a_candidate_that_breaks_a_rule_is_not_tried(task, monkeypatch):
    pair = adversary.Pair("BringCube", "gram", adversary.engines(["mujoco"])["mujoco"], 0, 10, None)
    run = adversary._Search(pair)
    broken = Candidate(Tool((component("far", (0.1, 0.1, 0.1), (1.0, 0.0, 0.0)),)), np.zeros((1, 6)))
    assert run.costs([broken]) == [(2.0, None)]
    assert run.rollouts == 0

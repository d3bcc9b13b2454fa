"""The embedded designer's guided strokes: found by rays, chosen by what holds a body, and useful in an engine."""

from pathlib import Path

import numpy as np
import pytest

from core.plugins import installed
from core.simulation.rollout import RolloutSettings, evaluate_batch
from plugins.vlms.offline.guided import guided, suits
from plugins.vlms.offline.raycast import frame_of, pushed, under
from plugins.vlms.offline.scene_analysis import UP
from tests.benchmarks.measuring import SOLUTIONS
from tests.plugins.vlms.test_offline import analysis, brief, candidates

SCENES = Path(__file__).parent / "guided"
NAMES = sorted(path.stem for path in SCENES.glob("*.yaml"))


def scene(name):
    file = SCENES / f"{name}.yaml"
    return installed().create("task", "file", file=str(file)) if file.exists() else installed().create("task", name)


def subgoal(task):
    return max(analysis(task).subgoals(np.random.default_rng(0)), key=lambda one: len(one.solids))


@pytest.mark.parametrize("way", [(1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (1, 2, -3)])
def test_a_frame_points_along_its_way(way):
    turn = frame_of(np.array(way, dtype=float)).rotation.as_matrix()
    assert turn[:, 0] == pytest.approx(np.divide(way, np.linalg.norm(way)))
    assert turn[2, 1] == pytest.approx(0.0)


def test_a_plunger_is_pushed_down_the_well():
    found = pushed(subgoal(scene("press_plunger")), -UP)
    for contact in found:
        assert contact.point == pytest.approx([0.68, 0.12, 0.05], abs=0.01)
        assert contact.half < 0.0225
        assert contact.length == pytest.approx(0.11, abs=0.002)  # of the rod inside the well
    assert found
    assert not pushed(subgoal(scene("press_plunger")), np.array([1.0, 0.0, 0.0]))


def test_a_plate_is_taken_where_it_stands_out():
    plate = subgoal(scene("turn_plate"))
    at = under(plate, 0.0, 0.016)
    assert at.depth == pytest.approx(0.03, abs=0.006)
    assert under(plate, np.pi, 0.016) is None


@pytest.mark.parametrize("name", [*NAMES, "InsertPlug"])
def test_every_scene_has_its_stroke(name):
    found = subgoal(scene(name))
    assert suits(found)
    assert guided(found, np.random.default_rng(0)) is not None


@pytest.mark.parametrize("name", sorted(path.stem for path in SOLUTIONS.glob("*.json")))
def test_what_lies_free_needs_none_of_these_strokes(name):
    assert not suits(subgoal(installed().create("task", name)))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "least"), [("press_plunger", 0.95), ("turn_plate", 0.95), ("InsertPlug", 0.95)])
def test_fresh_designs_earn(name, least):
    task, sim = scene(name), installed().create("sim", "mujoco")
    designs = candidates(brief(task, n_tool=4, n_action=1, seed=3))
    assert max(e.reward for e in evaluate_batch(task, sim, designs, 0, RolloutSettings())) >= least

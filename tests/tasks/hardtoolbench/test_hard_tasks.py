"""Requirements for every task of HardToolBench."""

import itertools
from pathlib import Path

import numpy as np
import pytest
import yaml

from core.config.compose import load, node
from core.design import Candidate, Tool
from core.interfaces import JointTrajectory, Rollout, RolloutSettings, Waypoints
from core.plugins import installed
from core.robot.solids import Obstacles, body_solids
from core.simulation.rollout import evaluate_batch
from core.values.layouts import Draw
from plugins.fitness.layouts.fitness import UNSEEN
from tests.benchmarks import layouts
from tests.engines import every_simulator, simulator
from tests.panda import ARM, FINGER_OPEN

CONF = Path(__file__).parents[3] / "conf" / "task"
TASKS = [n for (kind, n), of in installed().offers.items() if kind == "task" and of.entry_point == "hardtoolbench"]
MOVING = {"StopCart"}  # in which things move by themselves
SETTINGS = node(load("evaluate", ["protocol=varied"]).rollout, RolloutSettings)

every_task = pytest.mark.parametrize("name", TASKS)


def task_of(name, variation="wide"):
    return installed().create("task", name, variation=variation)


@every_task
def test_names_words_and_settings(name):
    task = task_of(name)
    assert task.name == name
    assert task.description.endswith(".")
    assert "\n" not in task.description
    assert f"class {name}(Task):" in task.source()
    for heading in ("Task: ", "Layouts: ", "Success: "):
        assert heading in type(task).__doc__
    config = yaml.safe_load((CONF / f"{name}.yaml").read_text())
    assert config["name"] == name
    assert set(task.variations) == {"near", "wide"}


@every_task
@pytest.mark.parametrize("variation", ["near", "wide"])
def test_a_variation_draws_all_that_it_names(name, variation, monkeypatch):
    asked = set()
    draw = Draw.__call__
    monkeypatch.setattr(Draw, "__call__", lambda self, key, nominal: asked.add(key) or draw(self, key, nominal))
    task = task_of(name, variation)
    task.scene(0)
    assert set(task.ranges) <= asked


@every_task
@pytest.mark.parametrize(("variation", "seed"), [("none", 0), ("near", 0), *(("wide", seed) for seed in range(8))])
def test_no_body_penetrates_another(name, variation, seed):
    scene = task_of(name, variation).scene(seed)
    for one, other in itertools.combinations([body for body in scene.bodies if body.collisions], 2):
        if (one.fixed and other.fixed) or frozenset((one.name, other.name)) in scene.joined:
            continue
        others = Obstacles(body_solids(other))
        for solid in body_solids(one):
            for _, gap in others.gaps(solid, 0.01):
                assert gap > -5e-5, f"{one.name} is {-1000 * gap:.2f} mm inside {other.name}"


@every_simulator
@every_task
def test_the_scene_rests_and_the_bare_arm_is_clear_of_it(name, engine):
    """Before the motion begins, and while the arm stays home, where nothing moves by itself."""
    for seed in (0, 1):
        task = task_of(name)
        still = JointTrajectory(np.zeros(1), ARM.home_for(task.home)[None], np.array([FINGER_OPEN]))
        hold = 0.0 if name in MOVING else 3.0
        (outcome,) = simulator(engine).rollout(task, [Rollout(Tool(), still, seed, settle_s=0.5, hold_s=hold)])
        assert outcome.error is None
        placed = task.scene(seed).state()
        assert np.linalg.norm(outcome.start.positions - placed.positions, axis=-1).max() < 5e-3
        assert outcome.tracking_error_rad < 2e-3
        assert np.linalg.norm(outcome.end.positions - outcome.start.positions, axis=-1).max() < 2e-3


@every_simulator
@every_task
def test_doing_nothing_earns_nothing(name, engine):
    task = task_of(name)
    home = Waypoints(np.array([[*task.home.position, *task.home.rpy]]))
    (found,) = evaluate_batch(task, simulator(engine), [Candidate(Tool(), home)], 0, SETTINGS)
    assert (found.status, found.reason) == ("ok", "")
    assert 0 <= found.reward < 0.02


@pytest.mark.slow
@every_simulator
@every_task
def test_the_reference_solution_fits_layouts_that_it_was_not_made_for(name, engine):
    """A few of those that docs/hardtoolbench.md has figures of."""
    anchored = layouts.designs(name, SETTINGS, "pla")["anchored"]
    task, seeds = task_of(name), range(UNSEEN, UNSEEN + (4 if engine == "mujoco" else 2))
    found = [evaluate_batch(task, simulator(engine), [anchored], seed, SETTINGS)[0] for seed in seeds]
    assert not [evaluation.reason for evaluation in found if evaluation.status != "ok"]
    assert np.mean([evaluation.reward for evaluation in found]) >= 0.7

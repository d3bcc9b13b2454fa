"""Scenes that need the words of scene files: a reference earns, what reaches for nothing does not."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.design import Tool, Waypoints
from core.designs.reading import load_designs, read_designs
from core.interfaces import JointTrajectory, Rollout
from core.plugins import installed
from core.robot.kinematics import arm_of
from core.scene import Camera
from core.solids.penetration import findings
from plugins.tasks.file.scene_warnings import find_unseen, find_warnings
from plugins.tasks.file.task import FileTask
from tests.support.engines import every_simulator, simulator
from tests.support.panda import on_panda
from tests.support.playing import evaluate_batch
from tests.support.scene_files import SCENES

BESIDE = [(0, 0, 0.15), (0, 0.3, 0), (0, -0.3, 0), (-0.2, 0, 0)]  # m


def rewards(scene, engine, shifts):
    """What the reference earns, moved by each of some shifts."""
    task = installed().create("task", "file", file=str(scene))
    boxes = installed().create("tool", "boxes")
    (design,) = read_designs(load_designs(scene.with_suffix(".json")), boxes, task)
    tried = []
    for shift in shifts:
        poses = design.plan.poses.copy()
        poses[:, :3] += shift
        tried.append(replace(design, plan=Waypoints(poses)))
    found = evaluate_batch(task, simulator(engine), tried)
    assert {evaluation.reason for evaluation in found} == {""}
    return np.array([evaluation.reward for evaluation in found])


@pytest.mark.parametrize("engine", ["mujoco", "pybullet"])
@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.stem)
def test_the_reference_solves_it(scene, engine):
    assert rewards(scene, engine, [(0, 0, 0)]) >= 0.9


@pytest.mark.slow
@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.stem)
def test_what_passes_beside_it_earns_little(scene):
    """Far above all it earns nothing: the robot then does nothing."""
    *beside, above = rewards(scene, "mujoco", [*BESIDE, (0, 0, 0.25)])
    assert above == 0
    # A push that ends before the niche brings the block a part of the way in.
    most = 0.5 if scene.stem == "IntoNiche" else 0.1
    assert max(beside) < most


def small(name):
    file = Path(__file__).parent / "small" / f"{name}.yaml"
    return on_panda(FileTask(str(file)))


def left_alone(name, engine):
    """What becomes of a scene in 8 s in which the robot does nothing: the outcome, and what is unphysical."""
    task = small(name)
    home = arm_of(task.robot).home_for(task.home)
    still = JointTrajectory(np.zeros(1), home[None], np.zeros(1))
    job = Rollout(Tool(), still, 1, settle_s=0.2, hold_s=8, record_hz=50)
    (outcome,) = simulator(engine).rollout(task, [job])
    assert outcome.error is None
    found = findings(task.scene(0), task.robot, Tool(), outcome.recording)
    return outcome.end, [finding.text for finding in found]


@every_simulator
def test_what_rolls_off_is_far_away_and_what_rises_leaves_the_scene(engine):
    end, (said,) = left_alone("rolls", engine)
    assert end.position("ball")[2] == pytest.approx(-0.613, abs=1e-3)
    assert re.fullmatch(r"'ball' is far away: it got to 5\.\d m from the robot", said)
    end, (said,) = left_alone("grav", engine)
    assert "left the scene" in said
    assert end.position("b1")[2] > 300


def test_a_cloth_rests_on_what_it_lies_on():
    end, said = left_alone("cloth_on_table", "mujoco")
    assert end.nodes("sheet")[:, 2] == pytest.approx(0.001, abs=2e-4)
    assert said == []


def test_small_scenes_mean_what_they_say():
    assert small("glob").goals[0].bodies == ("b1", "b2")
    assert small("kinds").tool_kinds == ("gripper",)
    (above,) = small("above").goals
    start = small("above").scene(0).state()
    for height, share in ((0.3, 1), (0.9, 1), (0.1625, 0.5)):
        end = replace(start, positions=np.array([[0.2, 0.1, height]]))
        assert above.progress(start, end) == pytest.approx(share)
    (warning,) = find_warnings(small("heavy").scene(0))
    assert warning == "body cube has 1.25e+06 kg/m^3; kilograms and metres are read"
    unseen = small("unseen")
    state = unseen.scene(0).state()
    assert find_unseen(unseen.camera, state, ["bar"]) == []
    assert find_unseen(Camera(), state, ["bar"]) == ["bar"]

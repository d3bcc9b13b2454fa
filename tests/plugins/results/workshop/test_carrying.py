"""Exported plans on an arm: here one that follows exactly, and feels a block where its mount comes low."""

import importlib.util
import json
import py_compile
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import create_autospec

import numpy as np
import pytest
from omegaconf import OmegaConf

from core.config.compose import task_parts
from core.designs.planning import resolve
from core.robot.kinematics import arm_of
from plugins.results.workshop.carrying import (
    DESIGN,
    SETTINGS,
    carry_out,
    dump_settings,
    load_export,
)
from plugins.results.workshop.export_command import configured
from plugins.results.workshop.policy import Policy
from plugins.results.workshop.texts import write_plan_programs
from plugins.robots.arms import panda, ur10
from tests.support.carried import TOUCH_Z, Exact, cubes, exported
from tests.support.guarded_blocks import ABOVE, DOWN, UP, Block
from tests.support.seen_cubes import CUBES, HIGH, LOOK, OVER, Cubes

PAYLOAD = {
    "mass_kg": 0.1,
    "center_m": [0.0, 0.0, 0.1],
    "inertia_kg_m2": np.eye(3).tolist(),
}


def carry(task, perceive, *steps, **settings):
    driver = Exact(arm_of(task.robot))
    plan = exported(task, *steps, **settings)
    waits = []
    policy = carry_out(
        plan, driver, perceive, clock=lambda: driver.seconds, wait=waits.append
    )
    return policy, driver, waits


def test_what_follows_a_touch_begins_where_the_arm_felt_it():
    policy, driver, _ = carry(Block(), dict, ABOVE, DOWN, UP)
    heights = [place[2] for place in driver.places]
    assert len(policy.felt) == 1
    np.testing.assert_allclose(heights, [TOUCH_Z, TOUCH_Z + 0.05], atol=0.003)
    assert policy.problem is None


def test_later_moves_go_where_bodies_are_seen_then():
    pictures = iter([cubes(), cubes(cube_1=(0.45, 0.1))])
    policy, driver, waits = carry(Cubes(), lambda: next(pictures), HIGH, LOOK, OVER)
    np.testing.assert_allclose(driver.places[-1], [0.45, 0.1, 0.37], atol=1e-3)
    assert len(policy.looks) == 1
    assert waits == [0.5]


def test_what_is_not_seen_is_taken_to_be_where_it_was():
    hidden = cubes()
    del hidden["cube_1"]
    pictures = iter([cubes(), hidden])
    policy, driver, _ = carry(Cubes(), lambda: next(pictures), HIGH, LOOK, OVER)
    assert policy.looks[0].hidden == ("cube_1",)
    np.testing.assert_allclose(driver.places[-1][:2], CUBES["cube_1"], atol=1e-3)


@pytest.mark.parametrize(
    ("seen", "words"),
    [
        ({}, "does not see cube_1, cube_2"),
        (cubes(cube_3=(0, 0)), "'cube_3'; possible: cube_1"),
        (cubes() | {"cube_1": [0.5, 0.2, 0.02]}, "cube_1 needs x, y, z"),
        (
            cubes() | {"cube_1": [0.5, 0.2, 0.02, 2, 0, 0, 0]},
            "needs x, y, z and a unit quaternion",
        ),
    ],
)
def test_a_function_that_says_nonsense_is_refused_before_the_arm_moves(seen, words):
    with pytest.raises(RuntimeError, match=words):
        carry(Cubes(), lambda: seen, HIGH, LOOK, OVER)


def test_a_loop_ends_once_its_goal_is_seen():
    done = cubes(cube_1=(0.6, 0.0), cube_2=(0.6, 0.0))
    pictures = iter([cubes(), cubes(), done])
    loop = {"repeat": [LOOK, OVER], "until_seen": {"goal": 0}, "at_most": 4}
    policy, driver, _ = carry(Cubes(), lambda: next(pictures), HIGH, loop)
    assert len(policy.looks) == 2
    assert len(driver.places) == 2


def test_a_plan_for_a_scene_file_is_read_in_a_folder_of_its_own(tmp_path, monkeypatch):
    design = json.loads(Path("tests/tasks/scenes/press_button.json").read_text())
    words = ["task=file", "task.file=tasks/scenes/press_button.yaml", "tool=boxes"]
    cfg = configured([*words, "designs=any.json"])
    (part,) = task_parts(cfg)
    settings = OmegaConf.to_yaml(OmegaConf.create(dump_settings(cfg, part)))
    (tmp_path / SETTINGS).write_text(settings)
    (tmp_path / DESIGN).write_text(json.dumps(design))
    monkeypatch.chdir(tmp_path)
    assert load_export(tmp_path).scene["button"].mass == 0.08


@pytest.mark.parametrize(
    ("robot", "names"),
    [
        (panda, {"drive_franky.py", "drive_ros2.py", "perceive.py", "run_plan.py"}),
        (ur10, {"drive_ur.py", "drive_ros2.py", "perceive.py", "run_plan.py"}),
    ],
)
def test_programs_are_python_for_the_robot(tmp_path, robot, names):
    body = ('a"""b', [0.0] * 7, True)
    write_plan_programs(robot(), PAYLOAD, [body], tmp_path)
    assert {file.name for file in tmp_path.iterdir()} == names
    for name in names:
        py_compile.compile(str(tmp_path / name), doraise=True)


def test_the_driver_of_franky_stops_where_the_guard_fires(tmp_path, monkeypatch):
    franky = pytest.importorskip("franky")
    robot = panda()
    write_plan_programs(robot, PAYLOAD, [], tmp_path)
    path = tmp_path / "drive_franky.py"
    spec = importlib.util.spec_from_file_location("drive_franky", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

    task = Block()
    plan = exported(task, ABOVE, DOWN)
    meaning = partial(
        resolve, plan.candidate.plan, task, 0, plan.settings, task.scene(0)
    )
    move = Policy(meaning, plan).begin()
    arm = arm_of(task.robot)

    class Tracker:
        def __init__(self, robot, stiffness, period):
            assert period == pytest.approx(0.01)
            self.targets = [move.samples.positions[0]]

        def __enter__(self):
            return self

        def __exit__(self, *error):
            return False

        def tick(self):
            return 0.01

        def set_target(self, target, velocity):
            self.targets.append(target)

        @property
        def state(self):
            low = arm.forward(self.targets[-1]).position[2] < TOUCH_Z
            wrench = [0.0, 0.0, 20.0 if low else 0.0, 0.0, 0.0, 0.0]
            return SimpleNamespace(q=self.targets[-1], O_F_ext_hat_K=wrench)

    control = create_autospec(franky.Robot, instance=True)
    control.current_joint_positions = move.samples.positions[0] + 0.04
    monkeypatch.setattr(franky, "Robot", lambda host: control)
    monkeypatch.setattr(franky, "JointImpedanceTracker", Tracker)
    driver = module.Driver("172.16.0.2")
    stopped = driver.move_until(move)
    height = arm.forward(stopped.joints).position[2]
    assert height == pytest.approx(TOUCH_Z, abs=0.003)
    control.current_joint_positions = move.samples.positions[0] - 0.06
    with pytest.raises(RuntimeError, match=r"joint \d is 0.06 rad from where"):
        driver.move_until(move)

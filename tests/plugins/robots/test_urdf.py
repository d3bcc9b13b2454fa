"""One's own arm from the command line: an outside arm that is written for these tests."""

from pathlib import Path

import numpy as np
import pytest

from core.config.compose import load, part
from core.errors import UserError
from core.plugins import installed
from plugins.commands import evaluate, render
from plugins.conformance.suites import SUITES
from tests.support.hands import gripped
from tests.support.outside_arm import FLANGE, HOME, write_arm
from tests.support.rare import rare
from tests.support.text import replaced_all

ROOT = Path(__file__).parents[3]
GRIPPER = "robot.gripper={link:hand_base,joints:[left,right],force_n:30}"


@pytest.fixture(scope="module")
def words(tmp_path_factory):
    file = write_arm(tmp_path_factory.mktemp("arm"))
    return [
        "robot=urdf",
        f"robot.path={file}",
        f"robot.flange={FLANGE}",
        f"robot.home={list(HOME)}",
    ]


@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.parametrize(
    "check", SUITES["robot"], ids=lambda check: check.__name__.removeprefix("check_")
)
def test_an_outside_arm_conforms(check, words):
    check(part("robot", load("evaluate", words).robot).create())


@pytest.mark.slow
@pytest.mark.usefixtures("inline")
@pytest.mark.parametrize("sim", rare(["mujoco", "pybullet", "sapien"], "mujoco"))
def test_it_performs_the_reference_solution(words, sim):
    designs = f"designs={ROOT}/tests/tasks/solutions/BringCube.json"
    (evaluation,) = evaluate.evaluate(
        load("evaluate", [*words, "task=BringCube", f"sim={sim}", designs])
    )
    assert evaluation.reward > 0.95


@pytest.mark.slow
@pytest.mark.parametrize("sim", ["mujoco", "pybullet"])
def test_it_is_drawn_in_its_own_colours(words, sim):
    picture, _ = render.render(
        load("render", [*words, "task=BringCube", f"sim={sim}"], render.RenderConfig)
    )
    pixels = picture.reshape(-1, 3).astype(int)
    assert (np.abs(pixels - (230, 120, 30)).sum(axis=1) < 60).sum() > 200, (
        "no orange of its turret"
    )


def test_settings_of_a_gripper(words):
    file = Path(words[1].removeprefix("robot.path="))
    ((old, new),) = gripped()
    file.with_name("gripped.urdf").write_text(
        replaced_all(file.read_text(), (old, new))
    )
    path = f"robot.path={file.with_name('gripped.urdf')}"
    chosen, again = (
        part("robot", load("evaluate", [*words, path, GRIPPER]).robot) for _ in range(2)
    )
    assert hash(chosen) == hash(again)  # it is made once per process
    robot = chosen.create()
    assert (robot.gripper.force_n, robot.finger_joints) == (30.0, ("right", "left"))


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({}, "setting 'path' is needed; settings: path, home, flange"),
        ({"path": "a.urdf", "home": ["a"]}, "setting 'home' can't be"),
        (
            {"path": "a.urdf", "home": [0.0], "gripper": {"link": "hand"}},
            "setting 'gripper' can't be .*: joints: is missing",
        ),
        (
            {
                "path": "a.urdf",
                "home": [0.0],
                "gripper": {"link": "hand", "joints": ["a", "b"], "force": 1.0},
            },
            "force: no key 'force'",
        ),
        ({"path": "a.urdf", "home": [0.0]}, "a.urdf can't be read: No such file"),
    ],
)
def test_settings_that_cannot_be(settings, reason):
    with pytest.raises(UserError, match=reason):
        installed().create("robot", "urdf", settings)

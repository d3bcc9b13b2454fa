from dataclasses import replace

import pytest

from core.plugins import installed
from plugins.vlms.context.facts import sheet
from tests.support.commands import python_m
from tests.support.panda import PANDA


def test_every_figure_has_a_row():
    figures = PANDA.measured
    assert set(figures) == {"mujoco", "pybullet", "sapien"}
    lines = sheet(PANDA).split("## Exactness")[1].splitlines()
    head, _, *rows = (
        line.strip("| ").split(" | ") for line in lines if line.startswith("| ")
    )
    assert head == ["figure", *figures]
    assert all(len(one) == len(rows) for one in figures.values())
    assert "full force at once" in sheet(PANDA)


def test_of_an_arm_that_was_not_measured_there_is_the_rest():
    text = sheet(replace(installed().create("robot", "ur5"), measured={}))
    assert text.startswith(
        "Universal Robots UR5: 6 joints, payload 5 kg, without a gripper."
    )
    assert "## Exactness" not in text
    assert "| wrist_3_joint | -0.2201 | -6.283 | 6.283 |" in text
    assert "|0.3|" in text


@pytest.mark.slow
def test_the_command_shows_the_stored_figures(tmp_path):
    done = python_m(tmp_path, "core", "facts")
    assert done.returncode == 0, done.stderr
    assert done.stdout == sheet(PANDA)

"""A tool as it may come out: off its dimensions, and bent into what it passes."""

from dataclasses import replace

import numpy as np
import pytest

from core.plugins import installed
from plugins.results.workshop.stage import Stage
from plugins.results.workshop.strength import Strength
from plugins.results.workshop.tolerance import (
    bend_tool,
    check_tolerance,
    draw_tools,
)
from tests.support.exports import exported
from tests.support.playing import condition
from tests.support.workshop_tools import post

ROW = Strength("post", "tool_mount", "wall", 1.0, "", 0.0, 0.2, 1e6, 9.0, 0.011)


def moved(row, point, shift):
    return replace(row, bearer="post", place=tuple(point), moved=tuple(shift))


def test_dimensions_are_off_by_as_much_as_is_said():
    sizes = [tool.components[0].shape.size for tool in draw_tools(post(0.2), 2e-4)]
    off = np.array(sizes) - post(0.2).components[0].shape.size
    assert np.allclose(np.abs(off), 2e-4)
    assert [(row > 0).all() for row in off] == [True, False, False]
    assert (off[1] < 0).all()


def test_a_load_s_place_is_where_the_load_moves_it():
    row = moved(ROW, (0.0, 0.0, -0.2), (0.011, 0.0, 0.0))
    bent = bend_tool(post(0.2), row).placed()["post"][1]
    assert np.allclose(bent.apply([0.0, 0.0, -0.1]), [0.011, 0.0, -0.2], atol=5e-4)


@pytest.mark.slow
def test_what_fits_too_closely_or_bends_into_things_is_red(tmp_path):
    found = exported(tmp_path)
    (fit,) = (check for check in found.checks if check.name in ("fit", "room"))
    assert fit.passed
    assert "with dimensions off by 0.2 mm it earns 1.000" in fit.found
    # As far as it takes to reach the next book.
    row = max(found.strengths, key=lambda row: row.bend_m)
    aside = np.roll(np.array(row.moved) * 0.06 / row.bend_m, 1)
    soft = replace(row, bend_m=0.06, moved=tuple(aside))
    where = condition(found.task, installed().create("sim", "mujoco"))
    stage = Stage({"mujoco": where}, found.scene)
    checks = check_tolerance(replace(found, strengths=[soft]), stage, 0.08)
    assert [check.passed for check in checks][:2] == [False, False]
    assert "bends it by 60.0 mm, into" in checks[1].found

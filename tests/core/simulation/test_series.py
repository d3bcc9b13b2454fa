"""What changes over time is read of a rollout: the way that is left to a goal, and what the robot presses."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from core.config.compose import load, part
from core.design import DesignError
from core.designs.reading import load_designs, read_designs
from core.simulation.series import read_series
from tasks.bring_cube import BringCube
from tests.support.engines import every_simulator, simulator
from tests.support.panda import on_panda
from tests.support.playing import condition

SOLUTIONS = Path(__file__).parents[2] / "tasks" / "solutions"


@cache
def played(engine):
    (given,) = read()
    where = condition(on_panda(BringCube()), simulator(engine))
    return {each.name: each for each in read_series(where, given)}


def read():
    cfg = load("evaluate", ["task=BringCube"])
    task = part("task", cfg.task).create()
    document = load_designs(SOLUTIONS / "BringCube.json")
    return read_designs(document, part("tool", cfg.tool).create(), task)


@every_simulator
def test_the_way_to_the_goal_and_the_force_are_read(engine):
    found = played(engine)
    left = found["cube off its place, left"]
    assert left.unit == "m"
    assert left.values[0] == pytest.approx(0.4, abs=0.01)
    assert left.values[-1] < 0.02
    pressed = found["force on cube"]
    first = int((pressed.values > 0).argmax())
    assert left.values[first - 2] == pytest.approx(left.values[0], abs=1e-3)
    np.testing.assert_array_equal(left.times, pressed.times)


def test_what_would_be_rejected_is_refused():
    (given,) = read()
    wrong = replace(given, problem="too heavy")
    with pytest.raises(DesignError, match="too heavy"):
        read_series(condition(on_panda(BringCube()), simulator("mujoco")), wrong)

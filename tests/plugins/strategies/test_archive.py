"""The best of each kind of tool and motion: what is filed where, and what a user gets."""

import csv
import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.config.compose import load
from core.design import Candidate, Component, Tool
from core.errors import UsageError
from core.geometry import Box, Pose
from core.plugins import installed
from core.trial import Evaluation, Trial, Where
from core.values.warnings import warn_once
from plugins.commands.evaluate import evaluate
from plugins.conformance.evaluations import tried_once
from plugins.fitness.several import score_by_worst_engine
from plugins.strategies.map_elites.archive import (
    Archive,
    Measure,
    lean_front,
    measure_extent,
    read_measures,
    save_archive,
)
from tests.core.run_folders import PLAN, hook

EXTENT, DISTANCE = Measure("extent", 0.0, 1.0, 10), Measure("distance", 0.0, 2.0, 4)


def earned(reward, distance=1.0, length=0.35, action=0, status="ok", mass=0.005):
    tool = hook(length)
    heavy = tuple(
        Component(c.name, c.parent, c.pose, c.shape, mass) for c in tool.components
    )
    return tried_once(
        Candidate(Tool(heavy), PLAN, 0, 0, action, 0),
        status,
        reward=reward,
        distance_m=distance,
    )


def best(*evaluations, tie=0.005):
    archive = Archive((EXTENT, DISTANCE))
    archive.add(evaluations)
    return {cell: e.candidate.id for cell, e in archive.best(tie).items()}


def test_each_cell_keeps_its_best():
    found = best(
        earned(0.5, action=0),
        earned(0.7, action=1),
        earned(0.9, length=0.55, action=2),
        earned(0.1, distance=1.7, action=3),
    )
    assert found == {
        (3, 2): "g0-a0-s1-p0",
        (3, 3): "g0-a0-s3-p0",
        (5, 2): "g0-a0-s2-p0",
    }


def test_in_a_cell_the_shorter_of_two_that_earned_about_the_same_is_the_best():
    pair = earned(0.900, 1.4, action=0), earned(0.896, 1.1, action=1)
    assert best(*pair) == {(3, 2): "g0-a0-s1-p0"}
    assert best(*pair, tie=0.0) == {(3, 2): "g0-a0-s0-p0"}


def test_what_was_not_tried_is_not_filed():
    assert best(earned(1.0, status="rejected"), earned(1.0, status="failed")) == {}


@given(distance=st.floats(), bins=st.integers(1, 100))
def test_every_value_has_a_bin(distance, bins):
    found = Measure("distance", 0.0, 2.0, bins).bin(earned(0.5, distance))
    if 0 <= distance < 2:
        assert found <= distance / 2 * bins < found + 1 + 1e-9
    else:
        assert found == (0 if distance < 0 else bins - 1)


def test_the_extent_is_the_longest_side_of_all_components_together():
    # The blade's other half lies below the shaft's end.
    assert measure_extent(hook(0.3)) == pytest.approx(0.303)
    assert measure_extent(Tool()) == 0
    pad = Component(
        "pad", "left_finger", Pose.xyz_rpy((9.0, 0.0, 0.0)), Box((0.02, 0.01, 0.05))
    )
    assert measure_extent(Tool((pad,), gripper=True)) == pytest.approx(0.05)


def test_where_a_tool_touches_is_the_mean_of_the_trials_in_which_it_does():
    (measure,) = read_measures(["touch"])
    near, never, far = (
        Trial(Where("BringCube", engine, 0), reward=0.5, touch_m=metres)
        for engine, metres in (("sapien", 0.31), ("mujoco", None), ("mujoco", 0.51))
    )
    assert [bin_of_trials(measure, trial) for trial in (near, never, far)] == [
        7,
        24,
        12,
    ]
    assert bin_of_trials(measure, never, far, near) == 10
    assert measure.bin(Evaluation(earned(0.5).candidate)) == 24


def test_it_is_said_once_that_touches_were_not_observed(caplog):
    warn_once.cache_clear()
    (measure,) = read_measures(["touch"])
    never = Trial(Where("BringCube", "mujoco", 0), reward=0.5, outcome="cube stays")
    bin_of_trials(measure, never)
    assert caplog.text == ""
    bin_of_trials(measure, replace(never, outcome=""))
    assert "set rollout.observe=true" in caplog.text


def bin_of_trials(measure, *trials):
    return measure.bin(
        Evaluation(earned(0.5).candidate, trials, score_by_worst_engine(trials))
    )


# --- the setting ------------------------------------------------------------------------------------------------


def test_measures_are_names_or_have_bounds_of_their_own():
    mass, distance = read_measures(
        [{"name": "mass", "upper": 0.1, "bins": 5}, "distance"]
    )
    assert mass == Measure("mass", 0.0, 0.1, 5)
    assert distance.name == "distance"


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ([], "measures is empty; name some of mass, extent"),
        (["weight"], "measure 'weight'"),
        (["mass", "mass"], "names mass twice"),
        (
            [{"name": "mass", "lower": 0.5, "upper": 0.5}],
            "mass goes from 0.5 to 0.5; lower must be less",
        ),
        ([{"name": "mass", "upper": math.inf}], "mass: upper: must be a finite number"),
        (
            [{"name": "mass", "bins": 0}],
            "mass: bins: must be greater than or equal to 1, got 0",
        ),
        ([{"name": "mass", "bins": "many"}], "mass: bins: "),
        ([{"name": "mass", "colour": "red"}], "key 'colour'"),
        ([{}], "measure 'None'"),
    ],
)
def test_wrong_measures(written, message):
    with pytest.raises(UsageError, match=message):
        read_measures(written)


# --- what is handed over ----------------------------------------------------------------------------------------


def saved(folder, *evaluations):
    archive = Archive((EXTENT, DISTANCE))
    archive.add(evaluations)
    save_archive(archive, evaluations, installed().create("tool", "urdf"), folder)
    rows = list(csv.DictReader((folder / "archive.csv").open()))
    return rows, [
        (row["cell_extent"], row["cell_distance"], row["picked"]) for row in rows
    ]


@pytest.mark.slow
def test_the_designs_of_an_archive_can_be_tried(tmp_path):
    rows, found = saved(
        tmp_path, *(earned(0.9, length=0.2 + 0.1 * i, action=i) for i in range(3))
    )
    assert found == [("2", "2", "best"), ("3", "2", ""), ("4", "2", "")]
    strategies = json.loads((tmp_path / "designs.json").read_text())["strategies"]
    assert len(strategies) == len(rows)
    words = [
        "task=BringCube",
        "material=paper",
        "sim=mujoco",
        "executor.workers=1",
        f"designs={tmp_path / 'designs.json'}",
    ]
    for row, tried in zip(rows, evaluate(load("evaluate", words)), strict=True):
        assert tried.status == "ok"
        assert tried.candidate.design == int(row["design"])
        assert measure_extent(tried.candidate.tool) == pytest.approx(
            float(row["extent_m"])
        )
        assert tried.candidate.tool.mass == pytest.approx(float(row["mass_kg"]))


@given(st.lists(st.tuples(st.floats(0, 9), st.floats(0, 9)), min_size=1))
def test_nothing_beats_the_front(points):
    tried = [
        SimpleNamespace(effort=SimpleNamespace(mass_kg=x, motion_s=y), holds=True)
        for x, y in points
    ]
    found = [(e.effort.mass_kg, e.effort.motion_s) for e in lean_front(tried)]
    for x, y in points:
        assert any(mass <= x and seconds <= y for mass, seconds in found)
    ahead = np.diff(np.array(found), axis=0)
    assert (ahead[:, :1] > 0).all()
    assert (ahead[:, 1:] < 0).all()

"""Designs, scenes and settings are refused with a code and values, which rows of ``tests/refusals`` name."""

import json
import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import docs.tables
from core.design import RIGID_MOUNT, Candidate, Component, DesignError, Tool
from core.designs.plan_rules import check_motion
from core.designs.rules import check_tool
from core.errors import CATALOGUE, Reason, Refusal, UserError, check_positive
from core.geometry import Box, Pose
from core.interfaces import JointTrajectory, RolloutSettings
from core.plugins import installed
from core.scene import Body
from core.simulation.attempt import prepare
from core.store.columns import trial_row
from core.store.rows import load_trial
from core.trial import Trial, Where
from core.values.materials import PAPER, Material
from core.values.refusals import DesignReason
from plugins.tools.urdf.representation import UrdfTools
from tests.support.panda import ARM, PANDA, on_panda
from tests.support.refusing import (
    DOORS,
    Row,
    find_refusals,
    fits,
    list_rows,
    refused,
)
from tests.support.scenes import CubeOnTable

ROWS = list(list_rows())
SOUND = [row for row in ROWS if row.sound is not None]
TEXTS = {row.door: row.text for row in ROWS}


@pytest.mark.parametrize("door", TEXTS)
def test_what_rows_change_is_sound(door, tmp_path):
    assert DOORS[door](TEXTS[door], tmp_path) == []


@pytest.mark.parametrize("row", ROWS, ids=str)
def test_a_change_is_refused_with_its_code_and_values(row, tmp_path):
    found = find_refusals(row, row.new, tmp_path)
    assert any(fits(refusal, row.code, row.values) for refusal in found), found
    json.dumps([refusal.dump() for refusal in found], allow_nan=False)


@pytest.mark.parametrize("row", SOUND, ids=str)
def test_what_is_on_the_other_side_of_a_limit_is_sound(row, tmp_path):
    assert find_refusals(row, row.sound, tmp_path) == []


def test_a_row_that_replaces_nothing_is_an_error(tmp_path):
    row = Row("settings", "seed=1", ["sed=1"], ["seed=x"], "E_UNKNOWN")
    with pytest.raises(AssertionError, match="no 'sed=1' to replace"):
        find_refusals(row, row.new, tmp_path)


# --- what no text at a door provokes ----------------------------------------------------------------------------


def box(name="a", at=(0, 0, -0.05), size=(0.02, 0.02, 0.1), **given):
    parent = given.pop("parent", RIGID_MOUNT)
    return Component(name, parent, Pose.xyz_rpy(at), Box(size), **given)


def check(*components, material=PAPER, robot=PANDA):
    check_tool(Tool(components), robot, material)


def swing(tool, **rules):
    """Let the arm swing to and fro for 100 s, through a block."""
    times = np.linspace(0.0, 100.0, 401)
    arm = np.tile(ARM.home, (401, 1))
    arm[1::2, 0] += 0.5
    trajectory = JointTrajectory(times, arm, np.zeros(401))
    grey = (0.5, 0.5, 0.5, 1)
    block = Body.of("block", Box((0.4, 0.4, 0.4)), (0.5, 0, 0.5), mass=0, color=grey)
    task = on_panda(CubeOnTable(block))
    check_motion(task, tool, task.scene(0), RolloutSettings(**rules), trajectory)


def plan_loops():
    endless = SimpleNamespace(most_seconds=lambda look_s: 121.0)
    prepare(
        on_panda(CubeOnTable()),
        Candidate(Tool((box(),)), endless),
        0,
        RolloutSettings(),
    )


PLA = Material("pla", 1240, young_pa=2.5e9, strength_pa=26e6)
SLABS = [
    box(f"c{k}", (0, 0, -0.0005 * k - 0.00025), (0.02, 0.02, 0.0005))
    for k in range(100)
]
FAR = box("b", (0.6, 0, -0.05), (1.1, 0.1, 0.1), parent="a", mass=2.5)
HEAVY = [box(f"c{k}", (0, 0, -0.05), (0.1, 0.1, 0.1), mass=0.999) for k in range(4)]


@pytest.mark.parametrize(
    ("refuse", "code", "values"),
    [
        (lambda: check(box("a b")), "E_NAME", {"name": "'a b'"}),
        (lambda: check(box("a" * 65)), "E_NAME", {}),
        (lambda: Tool((box(), box())), "E_NAMED_TWICE", {"name": "a"}),
        (
            lambda: Tool((box(parent="z"),)),
            "E_NO_PARENT",
            {"component": "a", "parent": "z", "mounts": "tool_mount"},
        ),
        (
            lambda: check_tool(Tool(gripper=True), installed().create("robot", "ur5")),
            "E_NO_GRIPPER",
            {"robot": "Universal Robots UR5"},
        ),
        (
            lambda: check(box(at=(0, 0, -0.005), size=(0.01,) * 3, mass=0.0009)),
            "E_TOO_LIGHT",
            {"mass_kg": 0.0009, "least_kg": 0.001},
        ),
        (
            lambda: check(*HEAVY),
            "E_TOO_HEAVY",
            {"mass_kg": 3.996, "most_kg": 3.0, "heaviest": "c0", "heaviest_kg": 0.999},
        ),
        (
            lambda: check(box(size=(0.1, 0.1, 0.1)), FAR, material=PLA),
            "E_MOMENT",
            {"heaviest": "b", "heaviest_kg": 2.5, "most_n_m": 12.0},
        ),
        (
            lambda: swing(Tool((box(),)), max_motion_s=99),
            "E_MOTION_TIME",
            {"time_s": 100.0, "most_s": 99},
        ),
        (
            lambda: swing(Tool(tuple(SLABS))),
            "E_MOTION_POSES",
            {"count": 100, "most": 2e6},
        ),
        (plan_loops, "E_LOOP_TIME", {"time_s": 121.0, "most_s": 120}),
        (
            lambda: on_panda(UrdfTools()).parse(
                {"tool_urdf": "x" * 1_000_001}, gripper=False
            ),
            "E_FIELD_LENGTH",
            {"field": "tool_urdf", "count": 1_000_001, "most": 1_000_000},
        ),
        (
            lambda: check_positive("budget.", n_agent=0),
            "E_NOT_POSITIVE",
            {"name": "budget.n_agent", "given": 0},
        ),
    ],
)
def test_a_refusal_in_python_has_its_code_and_values(refuse, code, values):
    with refused(code, **values):
        refuse()


# --- the catalogue ----------------------------------------------------------------------------------------------


def test_every_code_is_provoked():
    docs.tables.refusal_table()  # imports all catalogues
    codes = {row.code for row in ROWS}
    for file in Path(__file__).parent.rglob("test_*.py"):
        codes.update(re.findall(r'"(E_[A-Z_]+)"', file.read_text("utf-8")))
    assert sorted(CATALOGUE.keys() - codes) == []


def test_a_code_has_one_meaning():
    with pytest.raises(ValueError, match="two reasons have the code E_COUNT"):
        Reason("Again", {"COUNT": "something else"})


def test_codes_pass_up_with_what_was_added_to_the_words():
    inner = DesignError.because(DesignReason.COUNT, count=np.int64(101), most=100)
    placed = inner.placed("fixture: ", part="fixture")
    assert str(placed) == f"fixture: {inner}"
    (refusal,) = placed.refusals
    assert refusal == Refusal("E_COUNT", {"part": "fixture", "count": 101, "most": 100})
    outer = UserError("designs.json: it can't be read")
    outer.__cause__ = placed
    assert outer.refusals == placed.refusals
    assert UserError("no code").refusals == ()


def test_numbers_that_json_has_not_are_written_as_texts():
    assert Refusal("E_X", {"given": math.nan}).dump()["values"] == {"given": "nan"}


def test_the_store_keeps_the_words_of_a_trial_alone():
    refusals = (Refusal("E_X", {"given": math.nan}),)
    where = Where("BringCube", "mujoco", 0)
    trial = Trial(
        where, "g0-a0-s0-p0", "rejected", reason="too wide", refusals=refusals
    )
    again = load_trial(row_of(trial_row("content", trial)))
    assert again == trial
    assert again.reason == "too wide"
    assert again.refusals == ()


def row_of(columns):
    return {**columns, "details": json.dumps(columns["details"])}

"""Play recorded attacks again: designs of `tests/attacks` that once earned without the work (README.md there).

Each is tried as it is, and once more in MuJoCo with what stops it taken away: it must pay then, or it tests nothing.
"""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from core.designs.reading import read_designs
from core.interfaces import RolloutSettings
from core.plugins import installed
from tests.benchmarks.absurd import Watched
from tests.support.engines import mujoco_first, simulator
from tests.support.playing import evaluate_batch
from tests.support.rare import mostly
from tests.support.text import replaced_all

FOLDER = Path(__file__).parent / "attacks"
RULE, NO_RULE = "plugins.tools.joint_rules.check_joints", lambda *_: None
# Springs are played in the steps of an engine as those of others.
COARSE = "plugins.simulators.mujoco.model.choose_step", lambda *given: given[2]
# What stops an attack, what takes its place, and what each of its plans earns then in MuJoCo.
STOPPED_BY = {
    "AroundCorner": (RULE, NO_RULE, [1.0]),
    "LeverStone": (RULE, NO_RULE, [1.0]),
    "HangRing": (
        "tasks.hardtoolbench.hang_ring.SINKS",
        0.011,
        [1.0, 0.6],
    ),  # 51 mm, as it was, for a ring of 40 mm
    "SweepCards": ("tasks.hardtoolbench.sweep_cards.PRESS_N", math.inf, [3 / 13]),
}


BORN_BEHIND = "DislodgeCubeBornBehind"


def candidates(name):
    """Read an attack as a model's answer, and make its task."""
    document = json.loads((FOLDER / f"{name}.json").read_text())
    assert name.startswith(document["task"])
    task = installed().create("task", document["task"])
    tools, plans = (
        installed().create("tool", "boxes", {"joints": True}),
        installed().create("action", "anchored"),
    )
    return task, read_designs(document, tools, task, actions=plans)


def played(name, engine="mujoco", **settings):
    """Play an attack: evaluations, and what was recorded."""
    task, read = candidates(name)
    watched = Watched(simulator(engine))
    evaluations = evaluate_batch(
        task, watched, read, settings=RolloutSettings(**settings)
    )
    return evaluations, [outcome.recording for outcome in watched.outcomes]


def test_every_recorded_attack_is_played():
    assert {file.stem for file in FOLDER.glob("*.json")} == {
        *STOPPED_BY,
        "DislodgeCube",
        BORN_BEHIND,
        "StopCart",
        "TwoStations",
    }


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("AroundCorner", r"'plate' leaves what bears it, .* at 0.00545 m"),
        ("LeverStone", r"too strong a spring: it exerts 49.6 N m .* at most 3 N m"),
        ("DislodgeCube", r"springs could make 'paddle' 35.8 m/s fast; at most 13 m/s"),
    ],
)
def test_what_breaks_a_rule_is_refused(name, reason):
    _, (candidate,) = candidates(name)
    assert re.search(reason, candidate.problem or "")


@pytest.mark.slow
@mujoco_first
def test_a_ring_on_top_of_the_peg_earns_its_way_there_alone(engine):
    evaluations, _ = played("HangRing", engine)
    assert [evaluation.reward for evaluation in evaluations] == pytest.approx(
        [0.093, 0.093], abs=0.002
    )


@pytest.mark.slow
@mujoco_first
def test_cards_that_are_pressed_press_the_board(engine):
    (evaluation,), (recording,) = played("SweepCards", engine)
    assert evaluation.reward == 0
    if engine == "mujoco":  # its plate is made for this engine's contacts
        assert ("tool", "board") not in recording.forces
        assert (
            max(
                float(np.max(force))
                for pair, force in recording.forces.items()
                if pair[0] == "board"
            )
            > 15
        )


@pytest.mark.slow
@mujoco_first
def test_a_claw_that_is_pulled_through_its_stop_earns_nothing(engine):
    (evaluation,), _ = played("TwoStations", engine)
    assert evaluation.reward == 0
    assert "so that its reward of 0.50 does not count" in evaluation.reason


@pytest.mark.slow
@mujoco_first
def test_a_spring_waits_until_the_motion_begins(engine):
    """Then it pushes the cart that passes, which is work: it earns 1."""
    (evaluation,), (recording,) = played("StopCart", engine)
    carts = recording.states.position("cart")[recording.times <= 0]
    assert len(carts) > 5
    assert np.linalg.norm(carts - carts[0], axis=-1).max() < 1e-3
    assert evaluation.reward == 1


@pytest.mark.slow
@pytest.mark.parametrize("name", STOPPED_BY)
def test_without_what_stops_it_an_attack_pays(name, monkeypatch):
    target, instead, rewards = STOPPED_BY[name]
    monkeypatch.setattr(target, instead)
    monkeypatch.setattr(*COARSE)
    evaluations, _ = played(name)
    assert [evaluation.reward for evaluation in evaluations] == pytest.approx(
        rewards, abs=0.01
    )


@pytest.mark.slow
def test_a_joint_that_is_not_held_fires_before_the_motion(monkeypatch):
    pytest.importorskip("mujoco")
    monkeypatch.setattr(
        "plugins.simulators.mujoco.arm.Joints.hold", lambda *_, held: None
    )
    _, (recording,) = played("StopCart")
    carts = recording.states.position("cart")[recording.times <= 0]
    assert np.linalg.norm(carts[-1] - carts[0]) > 0.1


@pytest.mark.slow
def test_a_joint_beyond_its_stop_pays_where_penetration_is_ignored():
    (evaluation,), _ = played("TwoStations", penetration="ignore")
    assert evaluation.reward == 0.5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("steps", "penetration", "reward", "reason"),
    [
        (True, "ignore", 0, ""),
        (False, "forbid", 0, "deep inside 'pipe'"),
        (False, "ignore", 0.96, ""),
    ],
)
def test_a_part_that_strikes_through_a_wall_pays_where_nobody_looks(
    steps, penetration, reward, reason, monkeypatch
):
    """Its springs are refused. Without that rule an engine's smaller steps stop it, and else a look in each step."""
    pytest.importorskip("mujoco")
    monkeypatch.setattr(RULE, NO_RULE)
    if not steps:
        monkeypatch.setattr(*COARSE)
    task, read = candidates("DislodgeCube")
    engine = installed().create("sim", "mujoco")
    settings = RolloutSettings(penetration=penetration)
    (evaluation,) = evaluate_batch(task, engine, read, settings=settings)
    assert evaluation.reward == pytest.approx(reward, abs=0.02)
    assert reason in evaluation.reason


@pytest.mark.slow
@mujoco_first
@pytest.mark.parametrize("in_place", [False, True])
def test_a_tool_that_nothing_could_have_brought_is_rejected(
    engine, in_place, monkeypatch
):
    """Its plate is behind the cube, in the closed end of the pipe; on site it would pay."""
    task, read = candidates(BORN_BEHIND)
    monkeypatch.setattr(task, "tool_in_place", in_place, raising=False)
    (evaluation,) = evaluate_batch(task, simulator(engine), read)

    assert evaluation.reward == (1.0 if in_place else 0.0)
    if not in_place:
        assert evaluation.status == "rejected"
        assert "component 'plate' goes through 'cube'" in evaluation.reason


# In scene files: the most that each design earns; it was 0.54 to 1.00.
IN_SCENES = {
    "RaiseAndLetGo": 0.0,
    "OpenGate": 0.1,
    "SweepAll": 0.3,
    "HoldUp": 0.0,
    "LiftSponge": 0.0,
    "MoveEgg": 0.0,
}


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
@pytest.mark.parametrize("name", mostly(IN_SCENES, "LiftSponge"))
def test_words_of_scene_files_have_no_loopholes(name, engine):
    """A tray that leans on a wall, a gate at its turning point, 3 of 12 boxes, wires, and a blade in a soft ball."""
    if name == "LiftSponge" and engine != "mujoco":
        pytest.skip("this engine has no soft bodies")

    task, document = read_scene(name)
    reward = play_scene(task, document, engine)
    assert reward <= IN_SCENES[name]


@pytest.mark.slow
@mujoco_first
def test_a_gate_swings_on_beside_a_plan_that_lasts_longer(engine):
    """Where the two were judged in one trace, the gate stood still at its turning point until the other's end: 1.0."""
    task, document = read_scene("OpenGate")
    plans = document["strategies"][0]["action_sets"]
    longer = [*plans[0][:-1], plans[0][-1] | {"wait": 1.0}]
    alone = play_scene(task, document, engine)
    plans.append(longer)
    assert play_plans(task, document, engine)[0] == alone


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_an_egg_that_is_pushed_gently_is_not_struck(engine):
    """At 0.05 m/s it is pressed with up to 2 N (0.6 to 1.9), at 1 m/s with 10 to 27 N, and on the mean 0.3 to 1.9 N."""
    task, document = read_scene("MoveEgg")
    (plan,) = document["strategies"][0]["action_sets"]
    plan[-1] = {"offset": [0.55, 0.09, 0.27], "speed": 0.05, "wait": 0.5}
    assert play_scene(task, document, engine) > 0.85


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_an_egg_breaks_where_it_is_struck_and_not_where_it_is_pushed(tmp_path, engine):
    """It bears 5 N: see above."""
    task, document = read_scene("MoveEgg")
    text = (FOLDER / "scenes" / "MoveEgg.yaml").read_text()
    bearing = replaced_all(text, ("mass: 0.05}", "mass: 0.05, breaks_n: 5}"))
    file = tmp_path / "egg.yaml"
    file.write_text(bearing.partition("goals:")[0] + "goals:\n  - {broken: [egg]}\n")
    task = installed().create("task", "file", {"file": str(file)})
    assert play_scene(task, document, engine) == 1.0

    (plan,) = document["strategies"][0]["action_sets"]
    plan[-1] = {"offset": [0.55, 0.09, 0.27], "speed": 0.05, "wait": 0.5}
    assert 0.05 < play_scene(task, document, engine) < 0.25


def read_scene(name):
    """Make the task of an attack on a scene file, and read its document."""
    folder = FOLDER / "scenes"
    settings = {"file": str(folder / f"{name}.yaml")}
    task = installed().create("task", "file", settings)
    return task, json.loads((folder / f"{name}.json").read_text())


def play_scene(task, document, engine):
    (reward,) = play_plans(task, document, engine)
    return reward


def play_plans(task, document, engine):
    """Play all plans of a document together, and return what each earns."""
    tools = installed().create("tool", "boxes", {"joints": True})
    plans = installed().create("action", "anchored")
    read = read_designs(document, tools, task, actions=plans)

    return [
        evaluation.reward
        for evaluation in evaluate_batch(task, simulator(engine), read)
    ]

"""What a design may not choose: the frame in which it is measured, and what its fixture earns by itself."""

import json

import numpy as np
import pytest

from core.designs.reading import read_designs
from core.plugins import installed
from tests.support.engines import mujoco_first, simulator
from tests.support.panda import on_panda
from tests.support.playing import evaluate_batch
from tests.support.scene_files import task_of
from tests.support.text import replaced_all

STAND = "{bodies: [cup], at: fixture, place: [null, null, '> 0.1'], stands_on: fixture}"
SCENE = """name: Fixtures
description: A cup and a ball lie on the table, and a fixture is designed for them.
fixture: {box: [0.6, 0.7, 0.3], position: [0.6, 0, 0.15]}
bodies:
  - {name: cup, cup: {radius: 0.04, length: 0.09, wall: 0.003}, position: [0.6, 0, 0.045], mass: 0.1}
  - {name: ball, sphere: 0.03, position: [0.6, 0.2, 0.03], mass: 0.1, rolling_friction: 0.002}
goals:
  - GOAL
"""
INTO = "{bodies: [ball], inside: fixture, rest: true}"


def read(folder, goal, pose, *parts, path=((0.5, 0, 0.52),)):
    """Read a design whose fixture has boxes of a size at a position; its tool is a rod that gets to the places."""
    task = on_panda(task_of(folder, replaced_all(SCENE, ("GOAL", goal))))

    def box(number, size, position, parent):
        given = {"name": f"b{number}", "parent": parent, "size": size}
        return {**given, "shape": "box", "position": position, "mass": 0.03}

    stem = {**box(9, [0.03, 0.03, 0.2], [0, 0, -0.1], "tool_mount")}
    names = ["tool_mount", *(f"b{number}" for number in range(len(parts)))]
    boxes = [box(n, *part, names[n]) for n, part in enumerate(parts)]
    design = {
        "gripper": False,
        "tool_components": [stem],
        "action_sets": [[[*place, 0, 0, 0] for place in path]],
        "fixture": {"pose": pose, "tool_components": boxes},
    }
    boxed = installed().create("tool", "boxes")
    (found,) = read_designs(
        json.loads(json.dumps({"strategies": [design]})), boxed, task
    )
    return task, found


def ring(x):
    """Four walls, the first one at a pose that is 45 mm beside their middle."""
    return (
        [x, 0.245, 0, 0, 0, 0],
        ([0.09, 0.01, 0.07], [0, 0, 0.035]),
        ([0.01, 0.1, 0.07], [0.05, -0.045, 0.035]),
        ([0.09, 0.01, 0.07], [0, -0.09, 0.035]),
        ([0.01, 0.1, 0.07], [-0.05, -0.045, 0.035]),
    )


TILE = ([0.05, 0.09, 0.004], [0, 0, 0])


@pytest.mark.parametrize("turn", [(0, 0, 0.3), (np.pi / 2, 0, 0.3), (0.4, -0.7, 0.3)])
def test_a_fixtures_frame_stands_upright(tmp_path, turn):
    """Its solids are where the pose has them."""
    _, found = read(tmp_path, STAND, [0.6, 0.2, 0.1, *turn], TILE)
    fixture = found.tool.fixture
    assert fixture.pose.rpy[:2] == pytest.approx([0, 0])
    (part,) = fixture.parts.parts
    placed = fixture.pose @ part.pose
    assert placed.position == pytest.approx([0.6, 0.2, 0.1])
    assert placed.rpy == pytest.approx(turn)


@pytest.mark.parametrize(
    ("goal", "offset", "refused"),
    [(STAND, 0.04, False), (STAND, 0.06, True), (replaced_all(INTO, ("inside", "facing")), 0.06, False)],
)  # fmt: skip
def test_a_place_is_measured_from_within_the_fixture(tmp_path, goal, offset, refused):
    tile = ([0.05, 0.09, 0.004], [0, offset, 0.002])
    task, found = read(tmp_path, goal, [0.6, 0.14, 0, 0, 0, 0], tile)
    faults = "".join(task.find_goal_faults(found.tool.fixture))
    assert ("beside the box around its components" in faults) == refused


def channel(y):
    """Two walls and an end, open to the left."""
    return (
        [0.6, y, 0, 0, 0, 0],
        ([0.09, 0.01, 0.07], [0, -0.055, 0.035]),
        ([0.01, 0.11, 0.07], [0.04, 0, 0.035]),
        ([0.1, 0.01, 0.01], [0, -0.055, 0.075]),
        ([0.01, 0.11, 0.07], [-0.04, 0, 0.035]),
    )


BESIDE = ([0.6, -0.2, 0, 0, 0, 0], ([0.05, 0.05, 0.02], [0, 0, 0.01]))
AWAY = ((0.6, 0.3, 0.45), (0.6, 0.3, 0.22))
PUSHED = (*AWAY, (0.6, 0.15, 0.22))
NUDGED = (*AWAY, (0.6, 0.238, 0.22))
IDLE = ((0.5, 0, 0.52),)
LOW = "{bodies: [ball], at: fixture, place: [null, null, '< 0.05']}"
NEAR = "{bodies: [ball], at: fixture, place: [null, '> 0.3', null]}"
FAR = "{bodies: [ball], at: fixture, place: [null, '< 0.37', null]}"
AT = "{bodies: [ball], at: fixture, place: [0, 0, null], tolerance: 0.04}"
BOTH = AT + "\n  - {bodies: [ball], moved: [null, '< -0.05', null]}\nevery: true"
EITHER = LOW + "\n  - {bodies: [ball], moved: [null, '< -0.05', null]}\nevery: true"

# A goal, a fixture, what the arm does, and what is earned. Of what the fixture earns alone a cause says how much.
EARNED = [
    ("set around", INTO, ring(0.6), IDLE, 0.0, "alone earns 1.00"),
    ("beside", INTO, ring(0.75), IDLE, 0.0, ""),
    ("low anyway", LOW, BESIDE, IDLE, 0.0, "alone earns 1.00"),
    ("far anyway", NEAR, BESIDE, IDLE, 0.0, "alone earns 1.00"),
    ("far anyway, and pushed", NEAR, BESIDE, NUDGED, 0.0, "alone earns 1.00"),
    ("pushed in", AT, channel(0.105), PUSHED, 1.0, ""),
    ("nudged", AT, channel(0.105), NUDGED, 0.35, ""),
    ("pushed nearer", FAR, BESIDE, PUSHED, 1.0, ""),
    ("pushed in and moved", BOTH, channel(0.105), PUSHED, 1.0, ""),
    ("moved, and low anyway", EITHER, BESIDE, PUSHED, 0.5, "alone earns 0.50"),
]


@pytest.mark.slow
@mujoco_first
@pytest.mark.parametrize("row", EARNED, ids=[row[0] for row in EARNED])
def test_what_a_fixture_earns_beside_an_idle_arm_does_not_count(tmp_path, engine, row):
    _, goal, (pose, *parts), path, earned, said = row
    task, found = read(tmp_path, goal, pose, *parts, path=path)
    assert found.problem is None
    (evaluation,) = evaluate_batch(task, simulator(engine), [found])
    (trial,) = evaluation.trials
    assert trial.status == "ok", trial.reason
    near = {0: 0.001, 1: 0.01}.get(earned, 0.15)
    assert trial.reward == pytest.approx(earned, abs=near)
    assert trial.solved == (earned == 1)
    told = [trial.reason, *trial.warnings]
    assert any(said in text for text in told) if said else "alone" not in " ".join(told)

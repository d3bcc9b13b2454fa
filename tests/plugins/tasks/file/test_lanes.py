"""What each word of a scene file means in physics: a goal that is met by a little, and one that is missed by a little.

All of it happens side by side in one scene, `lanes.yaml`, which each engine plays once; what bonds do is in
`bonds.yaml`, what names a design's fixture in `fixture.yaml`, the ground and what the robot holds in `ground.yaml`,
where bodies and their copies have their faces in `shapes.yaml`, and what soft things do in `softs.yaml`. Each kind of
shape stands in a scene that is written here. The robot waits meanwhile.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from core.design import Component, Fixture, Tool
from core.geometry import Box, Pose
from core.interfaces import (
    RolloutSettings,
    Waypoints,
)
from plugins.tasks.file.spec import json_schema
from plugins.tasks.file.task import FileTask
from tests.support.engines import SIMULATORS, every_simulator, simulator
from tests.support.faults import candidate
from tests.support.lanes import (
    GOAL,
    LANES,
    SOFTS,
    STAYED,
    check_first_alone_is_met,
    earn,
    play,
    read,
)
from tests.support.panda import on_panda
from tests.support.playing import evaluate_batch
from tests.support.shapes import SAMPLES
from tests.support.text import replaced_all

BONDS = Path(__file__).parent / "bonds.yaml"
FIXTURE = Path(__file__).parent / "fixture.yaml"
GROUND = Path(__file__).parent / "ground.yaml"
SHAPES = Path(__file__).parent / "shapes.yaml"
GOALS = sorted((Path(__file__).parent / "goals").glob("*.yaml"))
WITHIN = "{bodies: [pea], inside: fixture}"
CARRIED = "{bodies: [load], held: true}"
LIFTED = "{bodies: [puller], raised: 0.09}"
RISEN = "{bodies: [lift], raised: 0.09}"

WEIGHED = "{bodies: [tray], raised: 0.09, weight: 3}\n  - {bodies: [far], raised: 0.1}\nevery: true"
AFTER = "\n  - {bodies: [tray], raised: 0.05, after: 0}\nevery: true"

# A key, a goal that is met by a little, and what of it makes another that is missed by a little.
MEANT = [
    ("velocity and friction", "{bodies: [sled], moved: ['> 0.09', null, null]}", "0.09", "0.112"),
    ("friction", "{bodies: [sled], moved: ['< 0.112', null, null]}", "0.112", "0.09"),
    ("mass, gravity and stiffness", "{joint: spring, to: '> 0.038'}", "0.038", "0.0405"),
    ("force of a latch", "{joint: strong, to: '< 0.01'}", "strong", "weak"),
    ("restitution", "{bodies: [hail], place: [null, null, '> 0.085'], ever: true}", "0.085", "0.105"),
    ("rest", "{bodies: [sled], moved: ['> 0.09', null, null], rest: true, ever: true}", "0.09", "0.112"),
    ("by_s", "{bodies: [tray], raised: 0.09, by_s: 0.6}", "0.6", "0.4"),
    ("ever", "{bodies: [hail], place: [null, null, '> 0.085'], ever: true}", ", ever: true", ""),
    ("any", "{bodies: [tray, sled], raised: 0.09, any: true}", ", any: true", ""),
    ("enough as a share", "{bodies: [tray, sled], raised: 0.09, enough: 0.5}", "0.5", "1.0"),
    ("enough as a number", "{bodies: [tray, sled], raised: 0.09, enough: 1}", "1}", "2}"),
    ("density", "{joint: sags, to: '> 0.038'}", "0.038", "0.0405"),
    ("upper", "{joint: falls, to: '< 0.052'}", "0.052", "0.048"),
    ("start", "{bodies: [drop], raised: '> -0.022'}", "-0.022", "-0.018"),
    ("spin", "{bodies: [spun], turned_deg: '> 55'}", "55", "59"),
    ("rolling_friction", "{bodies: [rolled], moved: [[0.095, 0.125], null, null]}", "[0.095, 0.125]", "'> 0.125'"),
    ("rolling_friction, at most", "{bodies: [rolled], moved: ['< 0.125', null, null]}", "0.125", "0.095"),
    ("damping", "{joint: sinks, change: '> 0.096'}", "0.096", "0.1"),
    ("friction of a joint", "{joint: grips, to: '< 0.005'}", "grips", "slides"),
    ("lower", "{joint: rises, to: '> -0.052'}", "0.052", "0.048"),
    ("width", "{joint: strong, to: '> 0.004'}", "0.004", "0.0045"),
    ("after", "{bodies: [vane], turned_deg: '> 20'}" + AFTER, "20", "58"),
    ("every", "{bodies: [tray], raised: 0.09}\n  - {bodies: [far], raised: 0.1}\nevery: false", "false", "true"),
    ("rest of a spring", "{joint: relaxes, to: '> 0.048'}", "0.048", "0.0505"),
    ("force of a drive", "{joint: hauls, to: '> 0.045'}", "hauls", "strains"),
    ("repeats", "{joint: shuttles, to: '> 0.02'}", "shuttles", "returns"),
    ("height of a mark", "{bodies: [pea], inside: deep}", "deep", "shallow"),
]  # fmt: skip

# What a rod shows that comes down on it, and where the rod's middle stops, m: 0.01 m above what it meets.
SHAPED = [
    ("tube", "through_tube", 0.01),
    ("wall", "on_tube", 0.07),
    ("floor, left out", "in_cup", 0.014),
    ("floor", "in_thick", 0.03),
    ("bottom", "in_bowl", 0.0452),
    ("handle", "on_handle", 0.077),
    ("handle, beyond it", "by_handle", 0.01),
    ("handle, left out", "on_other_handle", 0.077),
    ("bottle", "in_bottle", 0.014),
    ("neck", "on_neck", 0.13),
    ("neck_length", "on_shoulder", 0.0865),
    ("parts", "on_stairs", 0.07),
    ("roll and yaw", "on_rolled", 0.03),
    ("pitch", "on_upright", 0.11),
    ("at", "on_beside", 0.05),
    ("grid and spacing", "on_brick", 0.06),
    ("spacing, left out", "on_tile", 0.0704),
    ("ring", "on_peg", 0.04),
    ("heap", "on_lump", 0.055),
    ("heap, where it ends", "by_lump", 0.03),
]  # fmt: skip
NEAR_M = 0.002

JOINED = [
    ("origin", "{bodies: [flap], place: [0.55, 0.05, null], tolerance: 0.003}", "0.55", "0.556"),
    ("ball", "{bodies: [bob], place: ['< 0.745', '< -0.055', null], ever: true}", "0.745", "0.735"),
    ("parent", "{bodies: [rider], raised: 0.097}", "0.097", "0.103"),
    ("at of a latch", "{joint: catches, to: '> 0.0235'}", "0.0235", "0.0255"),
]  # fmt: skip

SOFT_SLAB = [
    ("node", "{bodies: [slab], node: 0, place: [0.47, 0.27, null], tolerance: 0.003}", "0.47", "0.48"),
    ("nodes", "{bodies: [thread], nodes: [0, 8], apart: '> 0.155'}", "0.155", "0.165"),
    ("pinned", "{bodies: [thread], node: 0, place: [0.6, -0.3, 0.3], tolerance: 0.002}", "node: 0", "node: 8"),
    ("young", "{bodies: [cord], node: 12, place: [null, null, '> 0.2885']}", "0.2885", "0.2925"),
    ("thickness", "{bodies: [hose], node: 3, place: [null, null, [0.009, 0.011]]}", "[0.009, 0.011]", "[0.011, 0.013]"),
    ("size and counts of a cloth", "{bodies: [rag], nodes: [0, 19], apart: '> 0.115'}", "0.115", "0.118"),
    ("friction of what is soft", "{bodies: [sticks], moved: ['< 0.005', null, null]}", "sticks", "slips"),
    ("density of what is soft", "{untouched: [table], by: [slab], max_force_n: 0.5}", "0.5", "0.35"),
]  # fmt: skip

BONDED = [
    ("broken", "{broken: [gives]}", "gives", "bears"),
    ("unbroken", "{unbroken: ['bears', tape, hook, upper, under]}", "bears", "gives"),
    ("breaks_n", "{bodies: [fell], raised: '< -0.25'}", "fell", "hung"),
    ("bonds", "{bodies: [level], axis: [1, 0, 0], points: [1, 0, 0], tolerance_deg: 2}", "level", "swung"),
    ("parent", "{bodies: [pulled], raised: 0.09}", "pulled", "torn"),
    # The middle of the board is 0.051 m from its hook, at 0.31 m.
    ("origin", "{bodies: [swung], place: [null, null, '< 0.262'], ever: true}", "0.262", "0.258"),
    ("any", "{broken: [gives, bears], any: true}", ", any: true", ""),
]  # fmt: skip

GROUNDED = [
    ("held", "{bodies: [load], held: true}", "load", "bar"),
    ("released", "{bodies: [low], place: ['< 1.5', null, null], released: true}", "released", "held"),
    ("floor_height", "{bodies: [fell], place: [null, null, '< -0.178']}", "-0.178", "-0.182"),
    # It falls for 0.1 s before the robot begins, and by 2.94 m in the second after that.
    ("gravity", "{bodies: [off], raised: '> -3.1'}", "3.1", "2.8"),
    ("size of the ground", "{bodies: [off], raised: '< -0.5'}", "off", "fell"),
    ("wall of the ground", "{bodies: [low], place: ['< 1.5', null, null]}", "low", "over"),
]  # fmt: skip

FURNISHED = [
    ("inside", "{bodies: [pea], inside: fixture}", "pea", "stray"),
    ("at", "{bodies: [pea], at: fixture, place: [0.01, 0, '< 0.0145']}", "0.0145", "0.0135"),
    ("on it", "{bodies: [bar], at: fixture, place: [null, null, '> 0.0395'], rest: true}", "0.0395", "0.0405"),
    ("stands_on", "{bodies: [bar], stands_on: fixture}", "bar", "stray"),
    ("facing", "{bodies: [bar], facing: fixture, axis: [0, 0, -1], tolerance_deg: 3}", "-1", "1"),
    ("untouched", "{untouched: [fixture], by: [stray]}", "stray", "pea"),
    ("by", "{untouched: [stray], by: [fixture]}", "stray", "bar"),
    ("max_force_n", "{untouched: [fixture], by: [bar], max_force_n: 1.5}", "1.5", "0.4"),
    ("throughout", "{bodies: [pea], inside: fixture, throughout: true}", "pea", "stray"),
]  # fmt: skip


# Keys that say nothing of physics, or that other tests play.
ELSEWHERE = {
    "in_words", "success_reward",  # what is told, and what counts as solved
    "color", "colors", "camera", "target", "fov_deg", "height_m", "pictures",  # what is seen
    "also",  # test_goals: joined keys are the same
    "variations", "noise_m",  # test_words, test_task
    "imports", "prefix", "without", "file", "scale",  # test_task, test_mjcf
    "tool_kinds", "tool_in_place", "payload_kg",  # what designs may be: test_words, test_attacks
    "smooth", "magnetic", "loops",  # what grips hold: simulators/test_grips
    "poisson",  # passed on to the engine: it has no figure that a scene would show
}  # fmt: skip


def test_every_key_of_the_format_has_a_row_or_a_reason():
    schema = json_schema()
    kinds = (schema, *schema["$defs"].values())
    keys = {key for kind in kinds for key in kind["properties"]}
    scenes = (LANES, BONDS, SOFTS, FIXTURE, GROUND, SHAPES)
    rows = (*MEANT, *BONDED, *FURNISHED, *GROUNDED, *SOFT_SLAB, *JOINED)
    said = "".join(
        [
            *(scene.read_text() for scene in scenes),
            *(row[1] for row in rows),
            *(file.read_text() for file in GOALS),
            HOLD,
            WEIGHED,
            write_kinds(),
        ]
    )
    shown = {key for key in keys if re.search(rf"\b{key}:", said)}
    assert keys - shown == ELSEWHERE


def bring_tray():
    """A tool whose design brings a tray of 0.1 x 0.1 m with walls of 0.03 m, in place of the robot's tool."""
    sides = {
        "floor": ((0.1, 0.1, 0.004), (0, 0, 0.002)),
        "left": ((0.1, 0.004, 0.026), (0, 0.048, 0.017)),
        "right": ((0.1, 0.004, 0.026), (0, -0.048, 0.017)),
        "far": ((0.004, 0.1, 0.026), (0.048, 0, 0.017)),
        "near": ((0.004, 0.1, 0.026), (-0.048, 0, 0.017)),
    }
    parts = [
        Component(name, "tool_mount", Pose(np.array(place)), Box(size))
        for name, (size, place) in sides.items()
    ]
    pose = Pose(np.array([0.6, 0.2, 0.0]))
    return Tool(fixture=Fixture(Tool(tuple(parts)), pose))


def hold_tray():
    """A tool that is a tray of 0.2 x 0.2 m below the flange."""
    rod = Component(
        "rod", "tool_mount", Pose(np.array([0.0, 0.0, -0.1])), Box((0.02, 0.02, 0.2))
    )
    floor = Component(
        "floor", "rod", Pose(np.array([0.0, 0.0, -0.1])), Box((0.2, 0.2, 0.006))
    )
    return Tool((rod, floor))


TRAY = bring_tray()
HELD_TRAY = hold_tray()


@pytest.mark.parametrize(("goal", "old", "new"), [row[1:] for row in MEANT], ids=[row[0] for row in MEANT])  # fmt: skip
def test_a_word_means_the_same_in_every_engine(tmp_path, goal, old, new):
    tasks = [
        read(tmp_path, [GOAL, asked] if limits(asked) else [asked])
        for asked in (goal, replaced_all(goal, (old, new)))
    ]
    for engine in SIMULATORS:
        check_first_alone_is_met(tasks, play(engine), engine)


@pytest.mark.parametrize("row", SHAPED, ids=[row[0] for row in SHAPED])
def test_a_shape_is_where_it_says(tmp_path, row):
    _, rod, height = row
    spans = (height - NEAR_M, height + NEAR_M), (height + NEAR_M, height + 3 * NEAR_M)
    tasks = [
        read(
            tmp_path,
            [f"{{bodies: [{rod}], place: [null, null, {list(span)}]}}"],
            SHAPES,
            RISEN,
        )
        for span in spans
    ]
    for engine in SIMULATORS:
        check_first_alone_is_met(tasks, play(engine, SHAPES), engine)


def write_kinds():
    """Write a scene of a body of each kind of shape: a rod comes down on its top, and one beside it."""
    bodies = []
    joints = []
    for number, shape in enumerate(SAMPLES):
        top = shape.extent(np.array([0.0, 0.0, 1.0]))
        vertices = shape.to_trimesh().vertices
        x, y, _ = vertices[vertices[:, 2].argmax()].round(4).tolist()
        away = -1.0 if x > 0 else 1.0  # from the rod on it
        side = away * (0.004 + shape.extent(np.array([away, 0.0, 0.0])))
        lengths = shape.numbers[0]
        if len(shape.numbers) > 1:
            lengths = shape.sizes if len(shape.sizes) > 1 else list(shape.numbers)

        place = [0.5 + 0.1 * number, -0.4, top]
        bodies += [{"name": shape.kind, shape.kind: lengths, "position": place, "fixed": True}]  # fmt: skip
        for where, (forward, left) in {"on": (x, y), "by": (side, 0.0)}.items():
            above = [place[0] + forward, place[1] + left, 2 * top + 0.018]
            rod = {"name": f"{where}_{shape.kind}", "box": [0.006, 0.006, 0.02]}
            bodies += [rod | {"position": above, "mass": 0.005}]
            joints += [{"name": f"j_{rod['name']}", "kind": "slider", "body": rod["name"],
                        "axis": [0, 0, -1], "damping": 0.3}]  # fmt: skip

    asked = {"goals": [{"bodies": [bodies[1]["name"]], "raised": 0.09}]}
    words = {
        "name": "Kinds",
        "description": "Rods come down on shapes and beside them.",
    }
    return yaml.safe_dump(words | {"bodies": bodies, "joints": joints} | asked)


@pytest.fixture(scope="module")
def kinds(tmp_path_factory):
    file = tmp_path_factory.mktemp("kinds") / "kinds.yaml"
    file.write_text(write_kinds())
    return file


@pytest.mark.parametrize("shape", SAMPLES, ids=lambda shape: shape.kind)
def test_a_kind_of_shape_is_where_it_says(kinds, shape):
    top = 2 * shape.extent(np.array([0.0, 0.0, 1.0]))
    for engine in SIMULATORS:
        _, end, _ = play(engine, kinds)
        for rod, height in (("on", top + 0.01), ("by", 0.01)):
            at = end.position(f"{rod}_{shape.kind}")[2]
            assert at == pytest.approx(height, abs=NEAR_M), (engine, rod)


@pytest.mark.parametrize("row", JOINED, ids=[row[0] for row in JOINED])
def test_a_joint_means_the_same_in_every_engine(tmp_path, row):
    _, goal, old, new = row
    asked = (goal, replaced_all(goal, (old, new)))
    tasks = [read(tmp_path, [one], SHAPES, RISEN) for one in asked]
    for engine in SIMULATORS:
        check_first_alone_is_met(tasks, play(engine, SHAPES), engine)


def test_goals_count_by_their_weight(tmp_path):
    task = read(tmp_path, [WEIGHED])
    for engine in SIMULATORS:
        start, end, trace = play(engine)
        assert task.reward(start, end, trace) == pytest.approx(0.75, abs=0.01), engine


@pytest.mark.parametrize("row", SOFT_SLAB, ids=[row[0] for row in SOFT_SLAB])
def test_a_word_of_soft_things_means_what_it_says(tmp_path, row):
    _, goal, old, new = row
    rewards = []
    for asked in (goal, replaced_all(goal, (old, new))):
        goals = [STAYED, asked] if limits(asked) else [asked]
        task = read(tmp_path, goals, SOFTS, STAYED)
        rewards.append(earn(task, play("mujoco", SOFTS)))

    assert rewards[0] == pytest.approx(1, abs=1e-6)
    assert rewards[1] < 0.999


@pytest.mark.parametrize("row", BONDED, ids=[row[0] for row in BONDED])
def test_a_bond_means_the_same_in_every_engine(tmp_path, row):
    _, goal, old, new = row
    missed = replaced_all(goal, (old, new))
    tasks = [
        read(tmp_path, [LIFTED, asked] if limits(asked) else [asked], BONDS, LIFTED)
        for asked in (goal, missed)
    ]
    for engine in SIMULATORS:
        check_first_alone_is_met(tasks, play(engine, BONDS), engine)


@pytest.mark.parametrize("row", FURNISHED, ids=[row[0] for row in FURNISHED])
def test_a_fixture_that_a_goal_names_means_the_same_in_every_engine(tmp_path, row):
    _, goal, old, new = row
    tasks = [
        read(tmp_path, [WITHIN, asked] if limits(asked) else [asked], FIXTURE, WITHIN)
        for asked in (goal, replaced_all(goal, (old, new)))
    ]
    for engine in SIMULATORS:
        played = play(engine, FIXTURE, TRAY)
        check_first_alone_is_met(tasks, played, engine)


@pytest.mark.parametrize("row", GROUNDED, ids=[row[0] for row in GROUNDED])
def test_the_ground_and_what_is_held_mean_the_same_in_every_engine(tmp_path, row):
    _, goal, old, new = row
    tasks = [
        read(tmp_path, [asked], GROUND, CARRIED)
        for asked in (goal, replaced_all(goal, (old, new)))
    ]
    for engine in SIMULATORS:
        played = play(engine, GROUND, HELD_TRAY)
        check_first_alone_is_met(tasks, played, engine)


def test_without_a_fixture_nothing_is_earned_where_it_is_named(tmp_path):
    asked = "{bodies: [pea], at: fixture, place: [0.01, 0, null], tolerance: 0.1}"
    task = read(tmp_path, [asked, "{bodies: [stray], raised: 0.1}"], FIXTURE, WITHIN)
    start, end, trace = play("mujoco", FIXTURE)
    assert task.reward(start, end, trace) == pytest.approx(0, abs=1e-3)
    assert list(task.find_goal_faults(None)) == []  # the other goal needs none


HOLD = """
name: Hold
description: A motor raises a block by 0.1 m/s from the robot's first motion on.
hold_s: 1.0
bodies:
  - {name: block, box: [0.04, 0.04, 0.04], position: [0.9, 0, 0.1], mass: 0.2}
joints:
  - {name: lift, kind: slider, body: block, axis: [0, 0, 1], lower: 0, upper: 1,
     drive: {times: [0, 5], positions: [0, 0.5], force: 50}}
goals:
  - {bodies: [block], raised: 0.13}
"""
"""The robot moves for 0.5 s, so that the block gets up by 0.15 m; with 0.4 s less by 0.11 m."""


@every_simulator
def test_the_robot_holds_still_for_hold_s_after_its_plan(tmp_path, engine):
    still = Waypoints(np.array([[0.5, 0.0, 0.5, 0.0, 0.0, 0.0]]))
    robot = replace(candidate(0), tool=Tool(), plan=still)
    settings = RolloutSettings(hold_s=0.0)
    rewards = []
    for held in ("1.0", "0.6"):
        file = tmp_path / "hold.yaml"
        file.write_text(replaced_all(HOLD, ("hold_s: 1.0", f"hold_s: {held}")))
        task = on_panda(FileTask(str(file)))
        (tried,) = evaluate_batch(task, simulator(engine), [robot], settings=settings)
        assert tried.reason == ""
        rewards.append(tried.reward)

    assert rewards[0] == 1
    assert rewards[1] < 0.95


def limits(goal):
    return any(word in goal for word in ("keep", "untouched", "unbroken", "throughout"))

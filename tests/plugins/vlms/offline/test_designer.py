"""The embedded designer's answers: the same for the same brief, and bred from what elites were made of."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from core.design import Candidate, Component, Tool
from core.designs.reading import read_designs
from core.geometry import Box, Pose
from core.interfaces import PAPER, Evaluation, Request, Score, Waypoints
from core.plugins import installed
from core.values.plans import NO_PLAN
from plugins.vlms.offline.answer import answer
from plugins.vlms.offline.hand import build_fingers, hand_of
from plugins.vlms.offline.heads import Head, box
from plugins.vlms.offline.layout import Layout
from plugins.vlms.offline.notes import read_recipe
from plugins.vlms.offline.options import find_unplanned
from plugins.vlms.offline.recipe import SHAFTS, Mount, Recipe
from plugins.vlms.offline.search import NothingSuits
from plugins.vlms.offline.vary import cross, mutate, mutate_mount
from plugins.vlms.offline.wants import list_unheeded
from plugins.vlms.offline.ways import WAYS
from tests.plugins.vlms.offline.trying import make_brief, read_task
from tests.support.errands import CUBE, NEARER, TURNED
from tests.support.panda import on_panda

BALL = """
  - {name: other, sphere: 0.03, position: [0.6, 0.3, 0.03], mass: 0.2}
"""
SECOND = """
  - {name: other, box: [0.06, 0.06, 0.06], position: [0.6, 0.3, 0.03], mass: 0.2}
"""
ROOT = Path(__file__).parents[4]
MOUNT = {"x": 0.3, "y": 0.0, "z": -0.2, "yaw": 0.0, "shaft": "elbow"}
LOWEST = {name: low for name, (low, _) in WAYS[0].ranges.items()}


@pytest.fixture
def brief(tmp_path):
    """Ask for three tools with two plans each."""
    asked = make_brief(read_task(tmp_path, CUBE, NEARER))
    return replace(asked, n_tool=3, n_action=2)


def read(document, brief):
    """Read the candidates of an answer."""
    base = Candidate(None, NO_PLAN)
    return read_designs(document, brief.representation, brief.task, base=base)


def start_run(designer, task, kinds):
    """Tell a designer that a run starts with some kinds of tools."""
    config = {"task": {"tool_kinds": kinds}}
    representation = installed().create("tool", "urdf")
    designer.run_started(
        SimpleNamespace(config=config, task=task, seed=0, representation=representation)
    )


def as_elites(candidates, reward=0.5):
    return tuple(Evaluation(c, score=Score(reward)) for c in candidates)


def test_the_same_brief_gets_the_same_answer(brief):
    first = answer(brief)
    assert json.dumps(answer(brief)) == json.dumps(first)
    assert json.dumps(answer(replace(brief, seed=8))) != json.dumps(first)
    found = read(first, brief)
    assert [c.problem for c in found] == [None] * 6
    assert len({c.content for c in found}) == 6


def test_offspring_are_made_anew_of_what_their_parents_were_made_of(brief):
    parents = read(answer(brief), brief)
    made_of = {c.id: read_recipe(c) for c in parents}
    assert all(made_of.values())

    bred = replace(brief, elites=as_elites(parents, reward=1.0), seed=3, generation=1)
    design = answer(bred)["strategies"][0]
    (parent, *_) = design["parents"]
    note, recipe = made_of[parent]
    assert design["note"]["way"] == note.way

    child = design["note"]["values"][0]
    assert {*child} == {*recipe.values}
    assert any(child[name] != recipe.values[name] for name in child)
    assert design["note"]["mount"] != vars(recipe.mount)


def test_strangers_are_varied_by_their_numbers(brief):
    bar = Component(
        "bar", "tool_mount", Pose(np.array([0, 0, -0.1])), Box((0.05, 0.05, 0.2))
    )
    plan = Waypoints(np.array([[0.5, 0.0, 0.4, 0, 0, 0], [0.6, 0.0, 0.4, 0, 0, 0]]))
    stranger = Candidate(Tool((bar,)), plan)
    assert read_recipe(stranger) is None

    elites = as_elites([stranger], reward=1.0)
    children = read(answer(replace(brief, elites=elites)), brief)
    assert [c.problem for c in children] == [None] * 6
    assert all(c.tool.components[0].shape.volume for c in children)
    assert len({c.plan.content for c in children}) > 1


@pytest.mark.parametrize(
    "note",
    [
        {"way": "push", "number": 0, "mount": MOUNT, "values": []},
        # An older version's.
        {"way": "push", "number": 0, "mount": MOUNT, "values": [{"width": 1.0}]},
        {"way": "push", "number": 0, "mount": None, "values": [LOWEST]},
        {"way": "push", "number": 0, "mount": {"x": 0.1}, "values": [LOWEST]},
        {"way": "fly", "number": 0, "mount": MOUNT, "values": [{}]},
        {"way": 1, "number": "first", "values": "none"},
        "hammered out of a bar",
    ],
)
def test_a_note_that_is_not_this_versions_is_a_strangers(brief, note):
    document = answer(brief)
    for design in document["strategies"]:
        design["note"] = note
    parents = read(document, brief)
    assert [read_recipe(c) for c in parents] == [None] * 6

    bred = replace(brief, elites=as_elites(parents, reward=1.0))
    assert [c.problem for c in read(answer(bred), brief)] == [None] * 6


def test_the_note_of_this_version_is_read(brief):
    """So what the notes above lack is what makes them a stranger's."""
    document = answer(brief)
    note = {"way": "push", "number": 0, "mount": MOUNT, "values": [LOWEST, LOWEST]}
    for design in document["strategies"]:
        design["note"] = note
    assert all(read_recipe(c) for c in read(document, brief))


def test_recipes_are_crossed():
    ranges = WAYS[0].ranges
    first = Recipe(LOWEST, Mount(**MOUNT))
    highest = {name: high for name, (_, high) in ranges.items()}
    second = Recipe(highest, Mount(0.4, 0.0, -0.3, 1.0, "slope"))

    mounts = set()
    for seed in range(10):
        crossed = cross(first, second, np.random.default_rng(seed))
        mounts.add(crossed.mount)
        for name, value in crossed.values.items():
            assert value in (LOWEST[name], highest[name])
        assert crossed.values not in (LOWEST, highest)

    assert mounts == {first.mount, second.mount}


def test_values_are_mutated():
    rng = np.random.default_rng(0)
    ranges = WAYS[0].ranges
    middle = {name: (low + high) / 2 for name, (low, high) in ranges.items()}
    changed = mutate(middle, ranges, 0.5, rng)
    assert {*changed} == {*middle}
    assert changed != middle
    assert mutate(middle, ranges, 0.0, rng) == middle


def test_mutated_values_stay_in_their_ranges():
    """A speed below zero would be as fast as the arm goes."""
    rng = np.random.default_rng(0)
    for way in WAYS:
        ranges = way.ranges
        for end in (0, 1):
            values = {name: ends[end] for name, ends in ranges.items()}
            for _ in range(20):
                values = mutate(values, ranges, 1.0, rng)
            for name, (low, high) in ranges.items():
                assert low <= values[name] <= high


def test_mounts_are_mutated_by_as_much_as_is_asked():
    rng = np.random.default_rng(0)
    mount = Mount(**MOUNT)
    assert mutate_mount(mount, 0.0, rng) == mount

    def find_changes(scale):
        mutated = [mutate_mount(mount, scale, rng) for _ in range(100)]
        assert {m.shaft for m in mutated} <= {*SHAFTS}
        return np.mean([abs(m.x - mount.x) for m in mutated])

    assert find_changes(1.0) > 3 * find_changes(0.1) > 0


def test_what_no_way_suits_is_named_before_the_search(tmp_path):
    task = read_task(tmp_path, CUBE, TURNED)
    (named,) = find_unplanned(task, 0, PAPER)
    assert "cube" in named
    with pytest.raises(NothingSuits, match="ask a model"):
        answer(make_brief(task))

    assert find_unplanned(read_task(tmp_path, CUBE, NEARER), 0, PAPER) == []


def test_what_only_fingers_do_is_unplanned_where_there_are_none():
    task = on_panda(installed().create("task", "SnatchCookie"))
    assert len(find_unplanned(task, 0, PAPER, ["rigid"])) == 1
    assert find_unplanned(task, 0, PAPER, ["rigid", "gripper"]) == []


@pytest.mark.parametrize(
    ("every", "bodies", "named"),
    [
        ("", CUBE + BALL, 0),  # one of both is enough
        ("every: true\n", CUBE + BALL, 1),  # no tool pushes and throws
        ("every: true\n", CUBE + SECOND, 0),
    ],
)
def test_goals_that_no_tool_does_together_are_named(tmp_path, every, bodies, named):
    goals = """
  - {bodies: [cube], place: [0.4, 0, null], tolerance: 0.02}
  - {bodies: [other], place: [%s, 0.3, null], tolerance: 0.1}
"""
    far = 2.0 if bodies.endswith(BALL) else 0.4
    task = read_task(tmp_path, bodies, goals % far + every)
    found = find_unplanned(task, 0, PAPER)
    assert len(found) == named
    assert all("one tool" in words for words in found)


@pytest.mark.parametrize(
    ("limit", "is_said"),
    [
        ("keep: [other]", False),
        ("untouched: [other]", False),
        ("unbroken: [other]", False),
        ("untouched: [cube], max_force_n: 5", True),
        ("untouched: [other], by: [cube]", True),
        ("bodies: [cube], axis: [0, 0, 1], throughout: true", True),
    ],
)
def test_limits_that_no_way_heeds_are_said_before_the_search(
    tmp_path, capsys, limit, is_said
):
    """A tool stays away from what it doesn't move, so that nothing has to be said of that."""
    bodies = CUBE + SECOND.replace("mass", "breaks_n: 50, mass")
    task = read_task(
        tmp_path, bodies, f"{NEARER}  - {{{limit}}}\n".replace('"*"', "cube")
    )
    assert len(list_unheeded(task, task.scene(0))) == is_said

    start_run(installed().create("vlm", "offline"), task, ["rigid"])
    assert ("pays no regard" in capsys.readouterr().err) == is_said


@pytest.mark.parametrize("name", ["BringCube", "SnatchCookie", "TurkeyLegs"])
def test_the_benchmark_is_planned_for(name):
    assert find_unplanned(on_panda(installed().create("task", name)), 0, PAPER) == []


def test_each_finger_gets_a_pad_where_the_head_is_aside(brief):
    """Out of reach, the head is so far from the hand that both pads are on one side of its middle."""
    layout = Layout(brief.task, 0, PAPER)
    pads = [box("left_pad", 0, -0.03, 0, (0.02, 0.01, 0.02))]
    pads.append(box("right_pad", 0, 0.03, 0, (0.02, 0.01, 0.02)))
    head = Head(pads, np.array([0, 0, 0.02]), "two pads")
    for aside in (-0.2, 0.0, 0.2):
        mount = hand_of(layout.robot).tips @ Pose(np.array([0, aside, -0.1]))
        tool = build_fingers(head, mount, 2.0, layout, "grip")
        sleeves = [c.parent for c in tool.components if c.name.endswith("sleeve")]
        assert sorted(sleeves) == ["left_finger", "right_finger"]


def test_an_arm_without_a_gripper_needs_no_fingers():
    task = installed().create("task", "SnatchCookie")
    task.robot = installed().create("robot", "ur5")
    assert len(find_unplanned(task, 0, PAPER)) == 1
    with pytest.raises(NothingSuits):
        answer(make_brief(task))


def test_a_plan_that_may_look_is_done_again_until_the_goal_is_seen(brief):
    actions = installed().create("action", "anchored", {"looks": True})
    design = answer(replace(brief, actions=actions))["strategies"][0]
    looks, plain = design["action_sets"]
    assert looks[0]["until_seen"] == {"goal": 0}
    assert all("repeat" not in step for step in plain)
    assert {step["anchor"] for step in plain} == {"cube"}


def test_a_given_tool_gets_plans_alone(tmp_path):
    task = read_task(tmp_path, CUBE, NEARER)
    document = answer(make_brief(task, gripper=True, tool="none"))
    assert "tool_urdf" not in document["strategies"][0]
    (candidate,) = read(document, make_brief(task, gripper=True, tool="none"))
    assert candidate.problem is None


def test_the_docs_have_each_way():
    page = (ROOT / "docs/designer.md").read_text()
    for way in WAYS:
        assert f"| `{way.name}` | {way.title} |" in page


def test_an_agent_whose_kind_of_tool_no_way_suits_makes_the_other_kind():
    """A cookie is taken out of its jar by fingers alone."""
    task = on_panda(installed().create("task", "SnatchCookie"))
    brief = make_brief(task, gripper=False)
    request = Request("g0-a0", brief, (), {}, 1.0)
    designer = installed().create("vlm", "offline")
    (reply,) = designer.complete([request])
    assert "no way of using a tool on the flange" in reply.error

    for kinds, is_answered in ((["rigid"], False), (["rigid", "gripper"], True)):
        start_run(designer, task, kinds)
        (reply,) = designer.complete([request])
        assert (reply.error is None) == is_answered

    (candidate,) = read(json.loads(reply.text), brief)
    assert candidate.problem is None
    assert candidate.tool.gripper

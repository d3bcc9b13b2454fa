"""A fixture: what a design adds to the scene, from the designs file and back, and what is wrong with one."""

import json
from dataclasses import replace

import jsonschema
import pytest

from core.design import Budget
from core.designs.reading import load_designs, load_tool, read_designs
from core.designs.start import SpawnRules
from core.designs.tool_fields import read_tool
from core.errors import UserError
from core.interfaces import RolloutSettings
from core.plugins import installed
from core.scene import FIXTURE
from core.search.assignment import Assignment
from plugins.results.artifacts import save_design
from tests.support.engines import simulator
from tests.support.panda import on_panda
from tests.support.playing import evaluate_batch
from tests.support.refusing import fits, refused
from tests.support.scene_files import SCENES
from tests.support.text import replaced_all

BOXES = installed().create("tool", "boxes")
(FUNNEL,) = [scene for scene in SCENES if scene.stem == "UseFunnel"]
DESIGNS = load_designs(FUNNEL.with_suffix(".json"))
(STRATEGY,) = DESIGNS["strategies"]
POST = STRATEGY[FIXTURE]["tool_components"][0]
FAR = {**POST, "name": "far", "parent": "post", "position": [0.1, 0, 0.1]}
WITHOUT = {key: value for key, value in STRATEGY.items() if key != FIXTURE}
HINGE = {"kind": "hinge", "axis": [0, 0, 1], "lower": -1, "upper": 1}


@pytest.fixture(scope="module")
def task():
    return on_panda(installed().create("task", "file", file=str(FUNNEL)))


def read(task, strategy, **given):
    (design,) = read_designs({"strategies": [strategy]}, BOXES, task, **given)
    return design


def test_a_fixture_is_read_and_written_and_stands_in_the_scene(task, tmp_path):
    design = read(task, STRATEGY)
    scene = task.scene(0)
    save_design(design, BOXES, tmp_path)
    (saved,) = read_designs(load_designs(tmp_path / "design.json"), BOXES, task)
    assert saved.content == design.content
    schema = {"properties": BOXES.schema()}
    jsonschema.validate(STRATEGY[FIXTURE], schema)
    rougher = replace(design, tool=replace(design.tool, friction=0.4))
    save_design(rougher, BOXES, tmp_path)
    (changed,) = json.loads((tmp_path / "design.json").read_text())["strategies"]
    again = read(task, changed).tool
    assert len(again.fixture.parts.components) == 5
    assert again.content != replace(again, fixture=None).content
    furnished = scene.furnished(again)
    assert furnished[FIXTURE].pose.position.tolist() == [0.75, 0, 0]
    assert scene.furnished(replace(again, fixture=None)) is scene


WRONG = [
    ({"pose": [0.9, 0, 0, 0, 0, 0]}, "E_FIXTURE_OUTSIDE", {"component": "east"}),
    ({"pose": [0.75, 0, 0.01, 0, 0, 0]}, "E_FIXTURE_HANGS", {"component": "post", "gap_mm": 10}),
    ({"pose": [0.75, 0, -0.01, 0, 0, 0]}, "E_FIXTURE_INSIDE", {"component": "post", "depth_mm": 10, "other": "table"}),
    ({"pose": [0.75, 0]}, "E_WAYPOINT_COUNT", {"where": "fixture: pose", "count": 2, "needed": 6}),
    ({"tool_components": [{**POST, "size": [0.01, 0.06, 9]}]}, "E_SIDE", {"component": "post", "side_m": 9}),
    ({"tool_components": [POST, FAR]}, "E_GAP", {"component": "far", "gap_mm": 20}),
    ({"tool_components": [{**POST, "joint": HINGE}]}, "E_ENTRY_UNKNOWN", {"where": "joint"}),
    ("a funnel", "E_NO_OBJECT", {"what": "'fixture'", "given": "the text 'a funnel'"}),
]  # fmt: skip


@pytest.mark.parametrize(("changes", "code", "values"), WRONG)
def test_what_is_wrong_with_a_fixture_is_said(task, changes, code, values):
    given = changes
    if isinstance(changes, dict):
        given = {**STRATEGY[FIXTURE], **changes}
    design = read(task, {**STRATEGY, FIXTURE: given}, start=SpawnRules(task))
    found = design.refusals
    assert any(fits(refusal, code, values) for refusal in found), found


def test_a_fixture_has_no_joints(task):
    joined = {**STRATEGY[FIXTURE], "tool_components": [POST, {**FAR, "joint": HINGE}]}
    boxes = on_panda(installed().create("tool", "boxes", joints=True))
    with refused("E_FIXTURE_JOINT"):
        read_tool({**STRATEGY, FIXTURE: joined}, boxes, False, task)


def test_without_its_fixture_it_earns_little(task):
    designs = [read(task, WITHOUT), read(task, STRATEGY)]
    settings = RolloutSettings()
    found = evaluate_batch(task, simulator("mujoco"), designs, settings=settings)
    without, whole = (evaluation.reward for evaluation in found)
    assert without < 0.1  # for a little of the way in
    assert whole == 1


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    """The task with a goal that names the fixture."""
    file = tmp_path_factory.mktemp("named") / "scene.yaml"
    file.write_text(
        replaced_all(FUNNEL.read_text(), ("inside: bottle", "inside: fixture"))
    )
    return on_panda(installed().create("task", "file", file=str(file)))


MISSING = "the goals of UseFunnel name the fixture, and the design has none; add"


def test_a_goal_that_names_the_fixture_asks_for_one(named):
    start = SpawnRules(named)
    assert MISSING in read(named, WITHOUT, start=start).problem
    assert read(named, STRATEGY, start=start).problem is None  # it has walls all around
    post = {**STRATEGY[FIXTURE], "tool_components": [POST]}
    solid = read(named, {**STRATEGY, FIXTURE: post}, start=start)
    assert "bodies must end inside it, and it has no hollow" in solid.problem


def save(strategy, folder):
    file = folder / "designs.json"
    file.write_text(json.dumps({"strategies": [strategy]}))
    return file


def test_a_tool_that_is_tried_without_the_fixture_that_goals_name_is_rejected(named):
    design = read(named, WITHOUT)
    (tried,) = evaluate_batch(named, simulator("mujoco"), [design])
    assert tried.status == "rejected"
    assert MISSING in tried.reason


def test_a_tool_of_a_file_is_read_whatever_the_goals_want(named, tmp_path):
    tool = load_tool(save(WITHOUT, tmp_path), 0, BOXES, named)
    assert tool.fixture is None
    assert len(tool.components) == len(read(named, STRATEGY).tool.components)


@pytest.mark.parametrize("name", ["none", "known"])
def test_a_given_tool_without_the_fixture_that_goals_name_ends_the_command(
    named, tmp_path, name
):
    settings = {}
    if name == "known":
        settings = {"file": str(save(WITHOUT, tmp_path)), "of": "boxes"}
    tools = installed().create("tool", name, **settings)
    actions = installed().create("action", "waypoints")
    assignment = Assignment(named, tools, actions, Budget(1, 1, 1, 0, 1, 0.5), seed=0)
    with pytest.raises(UserError, match=f"breaks a rule: {MISSING}"):
        _ = assignment.given
    with pytest.raises(UserError, match=f"breaks a rule: {MISSING}"):
        read_designs({"strategies": [WITHOUT]}, tools, named)


def test_a_task_without_a_place_for_a_fixture_refuses_one():
    design = read(on_panda(installed().create("task", "BringCube")), STRATEGY)
    assert [refusal.code for refusal in design.refusals] == ["E_NO_PLACE"]

"""The scene of ``vlmgineer new scene``, from the file to rollouts, pictures and prompts; and what files can say."""

import pickle
import re
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import trimesh

from core.design import Tool
from core.errors import UsageError, UserError
from core.geometry import Box, Mesh
from core.goals import (
    JointAt,
    Kept,
    Placed,
    Untouched,
)
from core.interfaces import JointTrajectory, Rollout
from core.plugins import PluginPart, installed
from core.robot.kinematics import arm_of
from plugins.conformance.suites import SUITES, examine
from plugins.new.new_command import write_scene
from plugins.tasks.file.goals import describe_goals
from plugins.tasks.file.task import FileTask
from plugins.tasks.file.tree import Tree
from plugins.vlms.context.bodies_table import bodies_table
from plugins.vlms.context.excerpts import helpers, task_source
from tests.support.engines import every_simulator, simulator
from tests.support.panda import on_panda
from tests.support.scene_files import FOLDER, OPEN_DOOR, task_of
from tests.support.text import replaced_all

ROOT = Path(__file__).parents[4]
SCENES = ROOT / "tasks/scenes"
URDF = """<robot name="lever"><link name="base"/><link name="arm"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry>
<box size="0.1 0.1 0.1"/></geometry></collision></link><joint name="pin" type="revolute"><parent link="base"/>
<child link="arm"/><axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>"""


@pytest.fixture(scope="module")
def scaffold(tmp_path_factory):
    return str(write_scene("PushBlock", tmp_path_factory.mktemp("scene") / "push.yaml"))


def test_the_scaffold_keeps_the_rules_for_tasks(scaffold):
    verdicts = list(examine("task", on_panda(FileTask(scaffold))))
    assert [v for v in verdicts if v.problem is not None] == []
    assert len(verdicts) == len(SUITES["task"])


@every_simulator
def test_the_scaffold_is_simulated_and_drawn(scaffold, engine):
    task = on_panda(FileTask(scaffold, "near"))
    still = JointTrajectory(
        np.zeros(1), arm_of(task.robot).home_for(task.home)[None], np.zeros(1)
    )
    (outcome,) = simulator(engine).rollout(
        task, [Rollout(Tool(), still, 1, settle_s=0.2, hold_s=0.2)]
    )
    assert outcome.error is None
    start, end = (
        task.scene(1).complete(state) for state in (outcome.start, outcome.end)
    )
    assert task.reward(start, end) < 0.01
    index = end.names.index("block")
    there = end.positions.copy()
    there[index] = [0.7, 0.1, 0.04]
    assert task.reward(start, replace(end, positions=there)) == pytest.approx(1)
    picture = simulator(engine).render(task, seed=0, width=64, height=48)
    assert picture.shape == (48, 64, 3)
    assert picture.std() > 1


def test_the_json_schema_fits_what_is_read(scaffold):
    """Editors check by it; models are shown it."""
    schema = installed().factory("task", "file").json_schema()
    validator = jsonschema.Draft202012Validator(schema)
    validator.check_schema(schema)
    pages = [
        ROOT / f"docs/{name}.md"
        for name in ("scene_files", "scene_things", "scene_keys", "scene_goals")
    ]
    page = "".join(page.read_text() for page in pages)
    keys = {*schema["properties"], *schema["$defs"]["Goal"]["properties"]}
    assert {key for key in keys if f"`{key}" not in page} == set()
    for kind in schema["$defs"].values():
        assert all(found["description"] for found in kind["properties"].values())
    for file in (scaffold, FOLDER / "open_door.yaml", *SCENES.glob("*.yaml")):
        data = Tree.read(Path(file))[1].data
        assert [error.message for error in validator.iter_errors(data)] == []
        assert list(validator.iter_errors({**data, "bodys": []}))


def test_a_variation_draws_layouts_and_none_ignores_the_seed(scaffold):
    usual = FileTask(scaffold)
    near = FileTask(scaffold, "near")
    assert usual.scene(0) == usual.scene(7)
    assert near.scene(3)["block"] == near.scene(3)["block"]
    places = {tuple(near.scene(seed)["block"].pose.position) for seed in range(20)}
    assert len(places) == 20
    assert all(
        0.97 <= x <= 1.03 and 0.07 <= y <= 0.13 and z == 0.04 for x, y, z in places
    )
    with pytest.raises(
        UsageError,
        match=r"no variation 'nar' in the task PushBlock \(did you mean 'near'\?\)",
    ):
        FileTask(scaffold, "nar")


def test_a_model_is_shown_the_file(scaffold, tmp_path):
    usual, near = (task_source(FileTask(scaffold, name)) for name in ("none", "near"))
    assert usual == near
    assert "box: [0.08, 0.08, 0.08]" in usual
    assert "variations:" not in usual
    assert usual.rstrip().endswith("# of the end-effector, at the start")
    assert "\nhome: {" in task_source(
        task_of(tmp_path, OPEN_DOOR + "home: {position: [0.5, 0, 0.5]}\n")
    )
    assert helpers(FileTask(scaffold)) == ""


def test_workers_make_the_same_task(scaffold):
    part = pickle.loads(
        pickle.dumps(
            PluginPart("task", "file", (("file", scaffold), ("variation", "wide")))
        )
    )
    task = part.create()
    again = pickle.loads(pickle.dumps(part.create()))
    assert task.name == again.name == "PushBlock"
    assert task.scene(5) == again.scene(5)


def test_a_drawn_start_moves_what_hangs_from_the_joint(tmp_path):
    usual, near = (
        task_of(tmp_path, OPEN_DOOR, name).scene(4) for name in ("none", "near")
    )
    (joint,) = near.joints
    assert 0 < joint.start <= 0.2
    assert near.state().joint("hinge").position == pytest.approx(joint.start)
    turned = near["door"].pose.rpy[2] - usual["door"].pose.rpy[2]
    assert turned == pytest.approx(joint.start)
    hinge = [scene["door"].pose.apply([0.16, 0, 0]) for scene in (usual, near)]
    np.testing.assert_allclose(*hinge, atol=1e-12)


def test_a_body_may_be_of_parts_with_a_density(tmp_path):
    door = task_of(tmp_path, OPEN_DOOR).scene(0)["door"]
    assert [type(geom.shape).__name__ for geom in door.collisions] == ["Box", "Sphere"]
    assert door.mass == pytest.approx(
        600 * sum(geom.shape.volume for geom in door.collisions)
    )
    assert door.pose.rpy[2] == pytest.approx(np.pi / 2)


def test_a_body_may_be_a_mesh(tmp_path):
    trimesh.creation.box((40, 20, 10)).export(tmp_path / "brick.stl")
    text = replaced_all(
        OPEN_DOOR, ("sphere: {radius: 0.04}", "file: brick.stl\n    scale: 0.001")
    )
    body = task_of(tmp_path, replaced_all(text, ("mass: 0.2", "density: 1000"))).scene(
        0
    )["ball"]
    assert body.mass == pytest.approx(0.008)
    assert isinstance(body.collisions[0].shape, Mesh)
    np.testing.assert_allclose(body.collisions[0].shape.bounds[1], [0.04, 0.02, 0.01])
    assert task_of(tmp_path, text).scene(0)["ball"].mass == 0.2


def test_what_is_elastic_is_soft(tmp_path):
    """The bodies and goals of the page: at rest as they are, and measured by their nodes."""
    page = Path("docs/scene_things.md").read_text()
    elastic = "elastic: {density: 200, young: 2.0e4}"
    shown = next(
        block
        for block in re.findall(r"```yaml\n(.*?)```", page, re.DOTALL)
        if "elastic" in block
    )
    text = f"name: Soft\ndescription: Press the dough, and bring the rope's end to a place.\n{shown}"
    verdicts = list(examine("task", on_panda(task_of(tmp_path, text, "softer"))))
    assert [verdict.problem for verdict in verdicts if verdict.problem] == []
    task = task_of(tmp_path, text)
    start = task_of(tmp_path, text).scene(0).state()
    nodes = {name: each.copy() for name, each in start.soft.items()}
    nodes["dough"] *= [1.1, 1.1, 0.5]
    done = replace(start, soft=nodes)
    assert task.reward(start, done) == pytest.approx(1)
    assert "dough must be at most 0.03 m high" in task.reward_in_words()[0]
    assert "(node 0 of its nodes" in task.reward_in_words()[1]
    assert "| rope | soft rope, as rubber; held at 1 of its nodes |" in bodies_table(
        task, 0
    )
    trimesh.creation.icosphere(radius=40).export(tmp_path / "ball.stl")
    mesh = replaced_all(
        OPEN_DOOR, ("sphere: {radius: 0.04}", "file: ball.stl\n    scale: 0.001")
    )
    mesh = replaced_all(
        mesh,
        ("mass: 0.2\n    velocity: [0.1, 0, 0]", f"{elastic}\n    counts: [4, 4, 4]"),
    )
    ball = task_of(tmp_path, mesh).scene(0)["ball"]
    np.testing.assert_allclose(
        np.linalg.norm(ball.form.nodes, axis=1).max(), 0.04, rtol=0.01
    )
    assert ball.mass == pytest.approx(200 * ball.form.volume)


def test_a_urdf_brings_bodies_and_joints(tmp_path):
    (tmp_path / "lever.urdf").write_text(URDF)
    found = "\nimports:\n  - {file: lever.urdf, prefix: a_, position: [0.3, 0.4, 0.5], rpy_deg: [0, 0, 90]}\n"
    task = task_of(
        tmp_path,
        replaced_all(OPEN_DOOR, ("joint: hinge, to: 1.2", "joint: a_pin, to: 0.9"))
        + found,
    )
    scene = task.scene(0)
    assert scene["a_arm"].collisions[0].shape == Box((0.1, 0.1, 0.1))
    np.testing.assert_allclose(scene["a_arm"].pose.position, [0.3, 0.4, 0.5])
    assert {joint.name for joint in scene.joints} == {"hinge", "a_pin"}


def test_what_is_left_out_of_a_file_is_reported_once(tmp_path, caplog):
    (tmp_path / "lever.urdf").write_text(
        replaced_all(URDF, ("</robot>", "<gazebo/></robot>"))
    )
    text = OPEN_DOOR + "\nimports:\n  - {file: lever.urdf, position: [0.3, 0.4, 0.5]}\n"
    task_of(tmp_path, text)
    task_of(tmp_path, text)
    lines = [record.getMessage() for record in caplog.records]
    assert lines.count(f"{tmp_path / 'lever.urdf'}: left out: 1 <gazebo>") == 1


def test_files_are_read_once(tmp_path):
    trimesh.creation.box((0.04, 0.02, 0.01)).export(tmp_path / "brick.stl")
    text = replaced_all(OPEN_DOOR, ("sphere: {radius: 0.04}", "file: brick.stl"))
    task = task_of(tmp_path, text, "near")
    (tmp_path / "brick.stl").unlink()
    assert task.scene(3)["ball"].mass == 0.2
    with pytest.raises(UserError, match=r"mesh .*can't be read: No such file"):
        FileTask(str(tmp_path / "scene.yaml"))


def test_goals_are_described_in_plain_words():
    goals = (
        JointAt(joint="drawer", to=0.2, by_s=3, name="open"),
        Placed(("cube", "other"), place=(0.7, None, 0), at="mark", any=True, after="open", rest=True),
        Untouched(("leaf",), max_force_n=5),
        Kept(("other",)),
    )  # fmt: skip
    *lines, formula, count = describe_goals(goals, every=True)
    assert lines == [
        "0. open: joint drawer must get to 0.2 m or rad; by 3 s after the motion begins",
        "1. cube or other must get to (0.7, any y, 0) in the frame of mark; must end at rest; after goal open",
        "2. the robot must not press harder than 5 N on leaf, or nothing is earned",
        "3. leave other in place: less is earned beyond 0.02 m, nothing from 0.1 m on",
    ]
    assert "1 - d / d0" in formula
    assert "mean" in count

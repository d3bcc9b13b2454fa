"""A run is whole in its folder: it goes on by its own copies of the files that it was begun with."""

import json
import shutil

import pytest
import trimesh

from core.config.compose import load, task_part
from core.config.gate import take_stored
from core.config.own_copies import FOLDER, INDEX, keep_inputs, use_copies
from core.config.remembered import remember
from core.errors import UserError
from core.robot.kinematics import arm_of
from tests.support.outside_arm import write_arm

SCENE = """\
name: PushPast
description: Push the block away from the robot.
bodies:
  - {name: block, file: parts/block.stl, position: [0.6, 0, 0.03], mass: 0.2}
goals:
  - {bodies: [block], place: ["> 0.75", null, null], rest: true}
"""


@pytest.fixture
def begun(tmp_path, monkeypatch):
    """The folder of a run of a scene file and an arm, and its configuration."""
    lab = tmp_path / "lab"
    (lab / "parts").mkdir(parents=True)
    monkeypatch.chdir(lab)
    trimesh.creation.box((0.05, 0.05, 0.05)).export("parts/block.stl")
    (lab / "push.yaml").write_text(SCENE)
    write_arm(lab)
    words = [
        "task=file",
        f"task.file={lab}/push.yaml",
        "robot=urdf",
        f"robot.path={lab}/outside_arm/urdf/arm.urdf",
        "robot.flange=tool0",
        "robot.home=[0,0.35,1.5,0,1.29,0]",
    ]
    cfg = load("evaluate", words)
    run = tmp_path / "run"
    run.mkdir()
    keep_inputs(run, cfg)
    config = {"task": dict(cfg.task), "robot": dict(cfg.robot)}
    for section in config.values():
        for key, value in section.items():
            section[key] = list(value) if hasattr(value, "_content") else value
    return run, cfg, config


def test_a_run_goes_on_in_any_folder_without_the_files_it_was_begun_with(
    begun, tmp_path, monkeypatch
):
    run, cfg, config = begun
    task = task_part(cfg).create()
    remember(config)
    monkeypatch.chdir(tmp_path)
    moved = tmp_path / "elsewhere"
    shutil.move(run, moved)
    shutil.rmtree(tmp_path / "lab")
    taken, _ = take_stored(config, moved, [])
    for section in ("task", "robot"):
        cfg[section] = taken[section]
    again = task_part(cfg).create()
    assert again.source() == task.source()
    assert again.scene(0).bodies[-1] == task.scene(0).bodies[-1]
    home = task.robot.home
    assert again.robot.home == home
    one, other = (arm_of(each.robot).forward(home).position for each in (task, again))
    assert one.tolist() == other.tolist()
    links = again.robot.description.links
    assert links.keys() == task.robot.description.links.keys()


def test_what_is_typed_counts_and_not_the_copy(begun):
    run, _, config = begun
    remember(config)
    for typed in ("task.file=push.yaml", "task=OneBook"):
        taken, _ = take_stored(config, run, [typed])
        assert str(run) not in str(taken["task"])
        assert taken["robot"]["path"].startswith(str(run))


def test_a_stranger_s_folder_has_to_be_typed_again_copies_or_not(begun):
    run, _, config = begun
    config["task"]["variation"] = "another"  # so that nobody has typed it here
    with pytest.raises(UserError, match=r"type it again: .*task\.file="):
        take_stored(config, run, [])


@pytest.mark.parametrize(
    "index",
    [
        "no json",
        "[1]",
        {"task.file": "../../lab/push.yaml"},
        {"task.file": "/etc/passwd"},
        {"task.variation": "task/lab/push.yaml"},
        {"vlm.command": "task/lab/push.yaml"},
        {"task.file": "task/none.yaml"},
    ],
)
def test_an_index_leads_to_nothing_but_copies_of_what_was_named(begun, index):
    run, _, config = begun
    text = index if isinstance(index, str) else json.dumps(index)
    (run / FOLDER / INDEX).write_text(text)
    config["vlm"] = {"name": "command", "command": []}
    assert use_copies(config, run, []) == config


def test_a_run_of_what_is_built_in_has_no_copies(tmp_path):
    keep_inputs(tmp_path, load("evaluate", ["task=OneBook"]))
    assert list(tmp_path.iterdir()) == []

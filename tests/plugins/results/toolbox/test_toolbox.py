"""The command on two small stored runs, whose tools are tried on each other's task."""

import json
import shutil
from types import SimpleNamespace

import pytest

import plugins.results.toolbox.tool_trials as trials
from core.design import Component, Tool
from core.designs.reading import load_designs, read_designs
from core.errors import UsageError, UserError
from core.geometry import Box, Pose
from core.plugins import installed
from plugins.results.pages.runs import find_runs
from plugins.results.toolbox.choice import ToolboxConfig, toolbox
from plugins.results.toolbox.held_tools import find_tools
from plugins.results.toolbox.library import read_library
from plugins.results.toolbox.toolbox_command import main, write
from tests.core.run_folders import hook, write_run
from tests.support.panda import PANDA
from tests.support.scene_files import SCENES
from tests.support.text import replaced_all

pytestmark = pytest.mark.slow

WORDS = ["budget.n_action=1", "budget.n_iteration=0", "executor.workers=1"]


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    root = tmp_path_factory.mktemp("runs")
    post = Component(
        "post",
        "tool_mount",
        Pose.xyz_rpy((0, 0, -0.21), (0, 0, 0)),
        Box((0.02, 0.02, 0.42)),
    )
    low = Tool((post,), name="low")
    same = ["sim=mujoco", "rollout.hold_s=0.2", "material=paper"]
    write_run(
        root / "a",
        "task=BringCube",
        *same,
        rewards=[[0.3, 0.95]],
        tools=[hook(0.1), hook(0.2, "hook")],
    )
    write_run(root / "b", "task=HighObject", *same, rewards=[[0.92]], tools=[low])
    return root


@pytest.fixture(scope="module")
def made(folders, tmp_path_factory):
    output = tmp_path_factory.mktemp("toolbox")
    found = toolbox([folders], ToolboxConfig(output=str(output)), WORDS)
    write(found, output)
    return found, output


@pytest.mark.thorough
def test_each_tool_has_its_stored_reward_and_is_tried_in_the_other_task(made):
    found, output = made
    assert [tool.tool.name for tool in found.tools] == ["hook", "low"]
    assert list(found.tasks) == ["BringCube", "HighObject"]
    (own, other), (tried, stored) = found.rewards
    assert (own, stored) == (0.95, 0.92)
    assert 0 <= other < 0.5
    assert 0 <= tried < 0.5
    assert len(list(output.glob("tried/*/*/*/run.sqlite"))) == 2
    assert [len(tools) for tools in found.sets] == [1, 2]
    assert found.done([0]) == ["BringCube"]


@pytest.mark.weekly
def test_an_interrupted_command_goes_on(made, folders, monkeypatch, tmp_path):
    found, _ = made
    searched = []
    search = trials.search

    def interrupted(config, folder, store):
        searched.append(folder)
        if len(searched) == 2:
            raise KeyboardInterrupt
        return search(config, folder, store)

    monkeypatch.setattr(trials, "search", interrupted)
    with pytest.raises(KeyboardInterrupt):
        toolbox([folders], ToolboxConfig(output=str(tmp_path)), WORDS)
    again = toolbox([folders], ToolboxConfig(output=str(tmp_path)), WORDS)
    assert len(searched) == 3
    assert searched[1] == searched[2] != searched[0]
    assert (again.rewards == found.rewards).all()


@pytest.mark.thorough
def test_the_table_has_the_rewards_and_the_chosen_are_designs(made):
    found, output = made
    head, *rows = (output / "rewards.csv").read_text().splitlines()
    assert head == "tool,BringCube,HighObject"
    assert [row.split(",")[0] for row in rows] == [tool.name for tool in found.tools]
    assert rows[0].split(",")[1] == "0.95"
    (file,) = output.glob("chosen/hook_*/design.json")
    task = installed().create("task", "BringCube")
    (read,) = read_designs(load_designs(file), installed().create("tool", "urdf"), task)
    assert read.tool is not None
    assert read.tool.content == found.tools[0].tool.content
    assert (read.plan.content, read.problem) == (
        found.tools[0].candidate.plan.content,
        None,
    )


@pytest.mark.thorough
def test_a_library_keeps_tools_and_stands_in_the_place_of_runs(folders, tmp_path):
    library = tmp_path / "library"
    main(["add", str(folders), f"output={library}"])
    files = sorted(library.glob("*/tool.json"))
    kept = [json.loads(file.read_text()) for file in files]
    assert [tool["tool"] for tool in kept] == ["hook", "low"]
    assert [tool["earned"] for tool in kept] == [
        {"BringCube": 0.95},
        {"HighObject": 0.92},
    ]
    assert kept[0]["printable"].startswith("printable: ")
    hook_held, low_held = read_library(library)
    (from_run, _) = find_tools(find_runs([folders])[0], top=1)
    assert hook_held.tool.content == from_run.tool.content
    assert hook_held.earned["BringCube"].reward == 0.95
    # What it earned at home is not tried again.
    config = ToolboxConfig(output=str(tmp_path / "out"), tasks=["HighObject"])
    low = tmp_path / "one"
    shutil.copytree(files[1].parent, low / files[1].parent.name)
    found = toolbox([low], config, WORDS)
    assert found.rewards.tolist() == [[0.92]]
    with pytest.raises(UsageError, match="a library names no tasks to try"):
        toolbox([library], ToolboxConfig(output=str(tmp_path / "none")), WORDS)
    assert low_held.name == files[1].parent.name


def test_a_library_that_was_changed_is_refused(folders, tmp_path):
    main(["add", str(folders / "a"), f"output={tmp_path}"])
    (file,) = tmp_path.glob("*/tool.json")
    facts = json.loads(file.read_text())
    for change, said in (
        ({"earned": {"BringCube": 2}}, "earned.BringCube"),
        ({"config": {}}, "config lacks"),
        (
            {"config": facts["config"] | {"tool": {"name": "${oc.env:HOME}"}}},
            "which is not resolved",
        ),
    ):
        file.write_text(json.dumps(facts | change))
        with pytest.raises(UserError, match=said):
            read_library(tmp_path)


def test_mistakes_are_one_line(folders, tmp_path):
    write_run(tmp_path / "c", "task=MoveBall", "seed=3", "sim=mujoco", rewards=[[0.4]])
    for words, said in (
        ([str(folders), "task=OneBook"], "task can't be set"),
        (
            [str(folders), str(tmp_path)],
            "the runs differ in material, rollout, seed; set for all of them material=",
        ),
        ([str(folders), "top=0"], "top must be at least 1"),
        (["good=0.5"], "no folder given"),
    ):
        with pytest.raises((UsageError, UserError), match=said):
            main([*words, f"output={tmp_path / 'out'}"])


def test_a_task_whose_goals_name_a_fixture_is_not_for_a_tool_without_one(tmp_path):
    """It is left out of the table, and does not end the command."""
    (funnel,) = [scene for scene in SCENES if scene.stem == "UseFunnel"]
    text = funnel.read_text()
    file = tmp_path / "scene.yaml"
    held = SimpleNamespace(tool=hook(0.2), representation=SimpleNamespace(robot=PANDA))
    config = SimpleNamespace(seed=0)
    for goal, starts in (("bottle", True), ("fixture", False)):
        file.write_text(replaced_all(text, ("inside: bottle", f"inside: {goal}")))
        assert (
            trials._starts(held, config, {"name": "file", "file": str(file)}) == starts
        )

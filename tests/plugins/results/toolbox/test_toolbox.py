"""The command on two small stored runs, whose tools are tried on each other's task."""

import pytest

import plugins.results.toolbox.trials as trials
from core.design import Component, Tool
from core.designs.reading import load_designs, read_designs
from core.errors import UsageError, UserError
from core.geometry import Box, Pose
from core.plugins import installed
from plugins.results.toolbox.choice import ToolboxConfig, toolbox
from plugins.results.toolbox.toolbox_command import main, write
from tests.core.run_folders import hook, write_run

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
    same = ["sim=mujoco", "rollout.hold_s=0.2"]
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


@pytest.mark.thorough
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
        found.tools[0].best.candidate.plan.content,
        None,
    )


def test_mistakes_are_one_line(folders, tmp_path):
    write_run(tmp_path / "c", "task=MoveBall", "seed=3", "sim=mujoco", rewards=[[0.4]])
    for words, said in (
        ([str(folders), "task=OneBook"], "task can't be set"),
        ([str(folders), str(tmp_path)], "the runs differ in (rollout|seed)"),
        ([str(folders), "top=0"], "top must be at least 1"),
        (["good=0.5"], "no folder given"),
    ):
        with pytest.raises((UsageError, UserError), match=said):
            main([*words, f"output={tmp_path / 'out'}"])

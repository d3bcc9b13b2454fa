"""The best tools of runs, given ones, and those that can't be shown."""

import pytest

from core.errors import UserError
from plugins.results.pages.best_tool import best_tool
from plugins.results.pages.runs import read_run
from tests.core.run_folders import edit, hook, write_run


def test_the_tool_is_that_of_the_best_candidate(tmp_path):
    folder = write_run(
        tmp_path / "run",
        rewards=[[0.5, 0.9], [0.8, 0.1]],
        tools=[hook(0.3, "long"), hook(0.2, "short")],
    )
    best = best_tool(read_run(folder))
    assert (best.name, best.run.best.reward, best.run.best.candidate[:2]) == (
        "short",
        0.9,
        "g0",
    )


def test_given_tools_are_known(tmp_path):
    bare = read_run(write_run(tmp_path / "bare", "tool=none"))
    stick = read_run(write_run(tmp_path / "stick", "tool=rlbench"))
    assert best_tool(bare).tool.components == ()
    assert best_tool(stick).name == "stick"


def test_parts_that_are_not_installed_are_said_to_be(tmp_path):
    folder = write_run(tmp_path / "run")
    edit(
        folder,
        """UPDATE run SET config = replace(config, '"BringCube"', '"Elsewhere"')""",
    )
    with pytest.raises(UserError, match="no task 'Elsewhere'"):
        best_tool(read_run(folder))

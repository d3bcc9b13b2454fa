"""The tools of runs: the best of each shape, given ones, and those that can't be shown."""

import pytest

from core.errors import UserError
from plugins.results.pages.runs import read_run
from plugins.results.pages.tools import winners
from tests.core.run_folders import edit, hook, write_run


def test_winners_are_the_best_of_each_shape(tmp_path):
    tools = [hook(0.3, "long"), hook(0.2, "short"), hook(0.3, "long again")]
    folder = write_run(tmp_path / "run", rewards=[[0.5, 0.9, 0.7], [0.8, 0.1, 0.2]], tools=tools)
    run = read_run(folder)
    assert [(w.name, w.reward, w.candidate[:2]) for w in winners(run)] == [("short", 0.9, "g0"), ("long", 0.8, "g1")]
    assert [w.name for w in winners(run, 1)] == ["short"]
    assert winners(run)[0].candidate == run.best.candidate


def test_given_tools_are_known(tmp_path):
    bare = read_run(write_run(tmp_path / "bare", "tool=none"))
    stick = read_run(write_run(tmp_path / "stick", "tool=rlbench"))
    assert [w.tool.components for w in winners(bare)] == [()]
    assert [w.name for w in winners(stick)] == ["stick"]


def test_parts_that_are_not_installed_are_said_to_be(tmp_path):
    folder = write_run(tmp_path / "run")
    edit(folder, """UPDATE run SET config = replace(config, '"BringCube"', '"Elsewhere"')""")
    with pytest.raises(UserError, match="no task 'Elsewhere'"):
        winners(read_run(folder))

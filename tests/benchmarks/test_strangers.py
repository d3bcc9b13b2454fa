"""The scenes of strangers can be loaded, rest, and earn nothing by themselves; the command searches them."""

import sys

import pytest

from core.errors import UsageError
from core.plugins import installed
from plugins.conformance.suites import examine
from tests.benchmarks import strangers

FILES = strangers.find_scenes([])
ROLLING = "StopBall"  # its ball moves by itself, and rests for a moment in the goal


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_scene_rests_and_earns_nothing_by_itself(file):
    task = installed().create("task", "file", file=str(file))
    task.robot = installed().default_robot

    problems = [found for found in examine("task", task) if found.problem]

    if task.name == ROLLING:
        (found,) = problems
        assert "what doing nothing earns" in found.problem
    else:
        assert problems == []


@pytest.mark.slow
@pytest.mark.thorough
def test_a_search_is_a_row(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["", "turn_screw", f"folder={tmp_path}"])
    strangers.main()

    head, row, last = capsys.readouterr().out.splitlines()
    assert head == strangers.HEAD
    assert row.startswith("turn_screw          0   1.000 ")
    assert last == "1 of 1 reach 0.9"


def test_an_unknown_scene_is_refused():
    with pytest.raises(UsageError, match="did you mean 'middle_pin'"):
        strangers.find_scenes(["middle_pins"])

"""Sets of three tasks that one tool can do: each has a reference by hand, a tool with a plan for each task."""

import json
from pathlib import Path

import pytest

from core.config.compose import load
from plugins.commands.evaluate import evaluate
from tests.support.rare import rare

FILES = sorted((Path(__file__).parent / "solutions" / "multitask").glob("*.json"))


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.parametrize("file", rare(FILES, FILES[0]), ids=lambda file: file.stem)
def test_one_tool_does_three_tasks(file):
    tasks = file.stem.split("_")
    (strategy,) = json.loads(file.read_text())["strategies"]
    assert [plan["task"] for plan in strategy["action_sets"][0]] == tasks
    words = [
        "task=multitask",
        f"task.of=[{','.join(tasks)}]",
        "tool=boxes",
        "sim=mujoco",
        "executor.workers=1",
    ]
    (found,) = evaluate(load("evaluate", [*words, f"designs={file}"]))
    assert found.warnings == ()
    assert min(found.figures.values()) >= 0.95


def test_there_are_three_sets():
    assert len(FILES) == 3
    assert len({frozenset(file.stem.split("_")) for file in FILES}) == 3
    for file in FILES:
        (strategy,) = json.loads(file.read_text())["strategies"]
        (plans,) = strategy["action_sets"]
        assert [plan["task"] for plan in plans] == file.stem.split("_")

import json
from typing import Any

import pytest

from core.config.compose import load
from core.errors import UsageError
from plugins.commands.evaluate import evaluate
from tests.support.solutions import TASKS as SOLVED

TASKS = "task=multitask", "task.of=[BringCube,ElevatePlate]"


def solution(task):
    strategy: dict[str, Any] = json.loads(
        (SOLVED / "solutions" / f"{task}.json").read_text()
    )["strategies"][0]
    return strategy


def tried(folder, strategy, *words):
    file = folder / "designs.json"
    file.write_text(json.dumps({"strategies": [strategy]}))
    return evaluate(
        load(
            "evaluate", [*words, f"designs={file}", "sim=mujoco", "executor.workers=1"]
        )
    )


def several(*sets):
    return {**solution("BringCube"), "action": "multitask", "action_sets": list(sets)}


def plan(task):
    return {
        "task": task,
        "action": "waypoints",
        "plan": solution("BringCube")["action_sets"][0],
    }


@pytest.mark.thorough
def test_each_task_is_tried_with_its_own_plan(tmp_path):
    (alone,) = tried(
        tmp_path,
        {**solution("BringCube"), "action_sets": [plan("")["plan"]]},
        "task=BringCube",
    )
    (both,) = tried(
        tmp_path, several([plan("BringCube"), plan("ElevatePlate")]), *TASKS
    )
    assert both.figures["BringCube"] == alone.reward > 0.9
    assert both.reward == pytest.approx(sum(both.figures.values()) / 2)
    assert [trial.task for trial in both.trials] == ["BringCube", "ElevatePlate"]
    assert both.rollouts == 2
    one = both.in_task("BringCube")
    assert (one.reward, one.status, one.candidate.plan.content) == (
        alone.reward,
        "ok",
        alone.candidate.plan.content,
    )


@pytest.mark.thorough
def test_the_worst_task_may_count(tmp_path):
    (both,) = tried(
        tmp_path,
        several([plan("BringCube"), plan("ElevatePlate")]),
        *TASKS,
        "task.combine=worst",
    )
    assert both.reward == min(both.figures.values()) < both.figures["BringCube"]


@pytest.mark.thorough
def test_a_plan_that_lacks_costs_its_task_alone(tmp_path):
    wrong = {"task": "ElevatePlate", "plan": [[1, 2]]}
    lacks, unread = tried(
        tmp_path, several([plan("BringCube")], [plan("BringCube"), wrong]), *TASKS
    )
    assert lacks.figures == unread.figures
    assert lacks.rollouts == 1
    assert "no plan for this task" in lacks.trials[1].reason
    assert "2 numbers" in unread.trials[1].reason


@pytest.mark.thorough
def test_a_tool_that_does_not_start_clear_in_one_task_is_tried_in_the_other(
    tmp_path,
):
    plans = several([plan("BringCube"), {**plan("BringCube"), "task": "LiftBox"}])
    (both,) = tried(tmp_path, plans, "task=multitask", "task.of=[BringCube,LiftBox]")
    clear, inside = both.trials
    assert clear.reward > 0.9
    assert (inside.status, inside.reward) == ("rejected", 0)
    assert "component 'blade' starts" in inside.reason
    assert both.figures == {"BringCube": clear.reward, "LiftBox": 0}


@pytest.mark.parametrize(
    ("of", "said"),
    [
        ("[BringCube]", "two or more different tasks"),
        (
            "[BringCube,{name: BringCube,variation: near}]",
            "two or more different tasks",
        ),
        (
            "[BringCube,{name: SnatchCookie,tool_kinds: [gripper]}]",
            "no tool kind in common",
        ),
    ],
)
def test_tasks_that_do_not_go_together(tmp_path, of, said):
    with pytest.raises(UsageError, match=said):
        tried(tmp_path, solution("BringCube"), "task=multitask", f"task.of={of}")

"""Plans for several tasks: they are written and read again, and each is looked up by its task."""

import numpy as np
import pytest

from core.design import Candidate, DesignError, Tool
from core.interfaces import Waypoints
from core.plugins import PluginPart, installed
from plugins.conformance.suites import SUITES, subject
from plugins.multitask.joined_plans import TaskPlans

HOME = [[0.5, 0.0, 0.4, 0.0, 0.0, 0.0]]
SEVERAL = installed().create("action", "multitask")


@pytest.mark.parametrize("check", SUITES["action"], ids=lambda check: check.__name__)
def test_it_conforms(check):
    check(subject(PluginPart("action", "multitask")))


def test_a_candidate_is_played_with_the_plan_for_a_task():
    plan = SEVERAL.parse(
        [{"task": "Push", "plan": HOME}, {"task": "Lift", "plan": [[1, 2]]}],
        gripper=False,
    )
    both = Candidate(Tool(), plan)
    assert isinstance(both.of("Push").plan, Waypoints)
    assert np.array_equal(both.of("Push").plan.poses, HOME)
    assert "2 numbers" in both.of("Lift").problem
    assert "no plan for this task" in both.of("Pour").problem


def test_what_is_wrong_with_a_plan_is_written_and_read_again():
    plan = TaskPlans((("Push", Waypoints(np.array(HOME))), ("Lift", "it slipped")))
    assert SEVERAL.parse(plan.dump(), gripper=False).content == plan.content


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ("home", "must be a list of objects"),
        ([HOME], "must be a list of objects"),
        ([{"plan": HOME}], "'task' of plan 1 is"),
    ],
)
def test_what_names_no_task_is_refused(data, said):
    with pytest.raises(DesignError, match=said):
        SEVERAL.parse(data, gripper=False)

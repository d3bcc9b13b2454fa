import numpy as np

from core.interfaces import RolloutSettings, Tempo
from tests.benchmarks.layouts import SOLUTIONS, designs, markdown
from tests.tasks.test_tasks import PAPER


def test_there_is_a_solution_for_each_task_of_the_paper():
    assert set(PAPER) <= set(SOLUTIONS)


def test_a_literal_plan_is_the_anchored_one_in_the_usual_layout():
    both = designs("BringCube", RolloutSettings())
    assert both["anchored"].tool == both["literal"].tool
    assert both["literal"].plan.poses.shape[1] == 6
    assert isinstance(both["literal"].plan.tempo, Tempo)


def test_the_table_has_the_means_and_the_worst_layout():
    rewards = {"anchored": {"one": [1.0, 0.5], "other": [0.9, 0.7]}, "literal": {"other": [0.1, 0.3]}}
    lines = markdown({"A": rewards, "B": rewards}, ["one", "other"]).splitlines()
    assert lines[0] == "| task | one | other | worst layout | literal plan, other |"
    assert lines[2] == "| A | 0.750 | 0.800 | 0.50 | 0.200 |"
    assert lines[4] == f"| **mean** | 0.750 | 0.800 |  | {np.mean([0.2, 0.2]):.3f} |"
    assert markdown({"A": rewards | {"literal": {}}}, ["one"]).splitlines()[2] == "| A | 0.750 | 0.50 |"

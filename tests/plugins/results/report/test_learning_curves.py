"""Courses of runs: rewards against what was spent, read from real stores."""

import numpy as np
import pytest

from core.store.reader import StoredRun
from plugins.results.report.command import report
from plugins.results.report.learning_curves import read_course
from tests.core.run_folders import write_run
from tests.plugins.results.report.test_tables import read_csv


def efforts(folder):
    report([folder / "runs"], folder / "out")
    return {row["method"]: row for row in read_csv(folder / "out" / "data" / "efforts.csv")}


def test_a_course_rises_with_candidates_and_counts_calls_by_generation(tmp_path):
    course = read_course(StoredRun(write_run(tmp_path, rewards=[[0.2, 0.4, None], [0.1, 0.7]], cost_usd=0.25)))
    assert course.best.tolist() == [0.2, 0.4, 0.4, 0.4, 0.7]
    assert course.rollouts.tolist() == [1, 2, 2, 3, 4]
    assert course.requests.tolist() == [1, 1, 1, 2, 2]
    assert course.cost.tolist() == [0.25, 0.25, 0.25, 0.5, 0.5]
    assert course.at(np.array([0, 1, 2.5, 100])).tolist() == [0, 0.2, 0.4, 0.7]
    assert (course.reached(0.4), course.reached(0.95)) == (1, None)


def test_there_is_none_without_a_store(tmp_path):
    folder = write_run(tmp_path)
    (folder / "run.sqlite").unlink()
    assert read_course(StoredRun(folder)) is None


def test_effort_is_what_all_runs_spent_by_those_that_reached_it(tmp_path):
    write_run(tmp_path / "runs" / "0", rewards=[[0.2, 0.4], [0.5, 0.99]], cost_usd=0.1)
    write_run(tmp_path / "runs" / "1", "seed=1", rewards=[[0.96, 0.4]], cost_usd=0.1)
    write_run(tmp_path / "runs" / "2", "seed=2", rewards=[[0.1, 0.2, 0.3]], cost_usd=0.1)
    write_run(tmp_path / "runs" / "3", "evolution=sampling", rewards=[[0.1]])
    found = efforts(tmp_path)
    row = found["evolution=vlmgineer"]
    assert (row["runs"], row["reached"], float(row["rollouts"])) == ("3", "2", (4 + 1 + 3) / 2)
    assert float(row["calls of the model"]) == (2 + 1 + 1) / 2
    assert float(row["cost (USD)"]) == pytest.approx(0.4 / 2)
    assert (found["evolution=sampling"]["reached"], found["evolution=sampling"]["rollouts"]) == ("0", "")

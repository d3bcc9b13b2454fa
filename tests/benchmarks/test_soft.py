"""The measurement of soft tasks beside rigid ones prints a row for each."""

import sys

import pytest

from tests.benchmarks import soft


@pytest.mark.slow
def test_soft_tasks_are_compared_with_the_median_rigid_one(monkeypatch, capsys):
    monkeypatch.setattr(soft, "FILES", dict.fromkeys(("BringCube", "LiftBox", "PullRope")))
    monkeypatch.setattr(sys, "argv", ["", "layouts=1"])
    soft.main()
    rows = [line.strip("| ").split(" | ") for line in capsys.readouterr().out.splitlines()[2:]]
    assert [row[0] for row in rows] == ["rigid", "PullRope"]
    assert float(rows[0][1]) > float(rows[1][1]) > 0

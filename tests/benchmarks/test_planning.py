import json
import sys

import pytest

from core.errors import UsageError
from core.simulation import attempt
from tests.benchmarks import planning

SCENE = planning.SCENES / "SweepIntoPan.yaml"

pytestmark = [pytest.mark.slow, pytest.mark.thorough]


def measure(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["", *words])
    planning.main()


def test_where_the_time_of_a_rollout_goes(tmp_path, monkeypatch, capsys):
    output = tmp_path / "planning.json"
    prepare = attempt.prepare
    words = ["tasks=BringCube", f"scenes={SCENE}", "plans=1", f"output={output}"]
    measure(monkeypatch, *words)

    rows = json.loads(output.read_text())
    assert [row["task"] for row in rows] == ["BringCube", "SweepIntoPan"]
    assert attempt.prepare is prepare

    for row in rows:
        assert row["rollouts"] == sum(row["tried"].values()) >= 1
        assert sum(row["stages"].values()) == pytest.approx(row["rollout"])
        assert row["designer"] > row["reading"] > 0
        assert row["stages"]["engine"] > row["stages"]["path"] > 0
        assert 0 < row["planning"] < 1

    table = capsys.readouterr().out.splitlines()
    assert [line.split(" | ")[0] for line in table[2:]] == [
        "| BringCube",
        "| SweepIntoPan",
        "| mean",
    ]


def test_what_cannot_be_measured_is_refused(monkeypatch):
    with pytest.raises(UsageError, match="tools must be at least 2"):
        measure(monkeypatch, "tools=1")
    with pytest.raises(UsageError, match="did you mean 'BringCube'"):
        measure(monkeypatch, "tasks=BringCub")

import json
import sys
from pathlib import Path

import pytest

from core.errors import UsageError
from tests.benchmarks import throughput

pytestmark = [pytest.mark.slow, pytest.mark.thorough]


def measure(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["", *words])
    throughput.main()


def test_where_the_time_of_a_population_goes(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))
    measure(monkeypatch, "tools=2", "plans=2", "workers=1", "time_step=0.004")
    found = json.loads((tmp_path / "throughput.json").read_text())
    assert found["rollouts"] == sum(found["tried"].values()) == 4
    assert found["sim"]["time_step"] == 0.004
    assert found["overhead"] == pytest.approx(found["wall_s"] / found["engine_s"])
    assert found["overhead"] > found["overhead_in_worker"] > 1
    assert sum(found["shares"].values()) == pytest.approx(1)
    assert all(
        found["shares"][part] > 0
        for part in ("stepping", "driving", "loading", "ik", "checks", "reward")
    )
    assert found["steps"] > 4 * 1.5 / 0.004  # settling and holding alone
    assert "4 rollouts with 1 workers" in capsys.readouterr().out


def test_what_it_does_not_know_is_said(monkeypatch):
    with pytest.raises(UsageError, match=r"did you mean 'tools'"):
        measure(monkeypatch, "tool=3")
    with pytest.raises(UsageError, match="tools must be at least 1"):
        measure(monkeypatch, "tools=0")
    with pytest.raises(UsageError, match="pybulet"):
        measure(monkeypatch, "sim=pybulet")

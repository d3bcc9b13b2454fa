import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from core.errors import UsageError
from tests.benchmarks import clocked, throughput

pytestmark = [pytest.mark.slow, pytest.mark.thorough]


def measure(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["", *words])
    throughput.main()


def test_where_the_time_of_a_population_goes(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))
    measure(monkeypatch, "tools=2", "plans=2", "workers=1", "reference=1", "ceiling=20", "time_step=0.004")
    found = json.loads((tmp_path / "throughput.json").read_text())
    assert found["rollouts"] == sum(found["tried"].values()) == 4
    assert found["sim"]["time_step"] == 0.004
    assert found["rollouts_per_s"] == pytest.approx(4 / found["wall_s"])
    assert found["overhead"] == pytest.approx(found["wall_s"] / found["engine_s"])
    assert found["overhead"] > found["overhead_in_worker"] > 1
    assert sum(found["shares"].values()) == pytest.approx(1)
    assert found["shares"]["stepping"] == pytest.approx(1 / found["overhead"])
    assert all(found["shares"][part] > 0 for part in ("driving", "loading", "ik", "checks", "reward"))
    assert found["steps"] > 4 * 1.5 / 0.004  # settling and holding alone
    assert found["memory"]["parent_peak_mb"] > 50
    assert [worker["peak_mb"] > 50 for worker in found["memory"]["workers"]] == [True]
    assert found["reference"]["rollouts"] == 1
    assert found["times_the_reference"] > 1
    assert found["parent"]["stored_per_s"] > 1
    assert "4 rollouts with 1 workers" in capsys.readouterr().out


def test_the_reference_tries_what_the_population_tries(tmp_path):
    (candidate,) = throughput.designs("BringCube", 1, 1, 0)
    file = tmp_path / "designs.json"
    representation = throughput.installed().create("tool", "urdf")
    file.write_text(json.dumps({"strategies": [throughput.dump_design(candidate, representation)]}))
    arguments = {"task_name": "BringCube", "sim": "pybullet", "designs": str(file), "number": 0, "seed": 0}
    words = [sys.executable, "-m", "tests.benchmarks.clocked", json.dumps(arguments)]
    root = Path(__file__).parents[2]
    done = subprocess.run(words, cwd=root, capture_output=True, text=True, check=True)
    evaluator = throughput.Evaluator(
        throughput.PluginPart("task", "BringCube"), throughput.PluginPart("sim", "pybullet")
    )
    (evaluation,) = evaluator([candidate])
    assert float(done.stdout.splitlines()[-1]) == pytest.approx(evaluation.reward, abs=0.05)


def test_growth_is_that_after_the_first_rollouts():
    rollouts = np.arange(400)
    assert throughput.growth(rollouts, np.where(rollouts < 200, rollouts, 200.0)) == pytest.approx(0, abs=1e-6)
    assert throughput.growth(rollouts, 100 + 0.5 * rollouts) == pytest.approx(512)
    assert throughput.growth(rollouts[:100], np.ones(100)) is None


def test_memory_is_this_process_own():
    assert 10 < clocked.resident_mb() <= clocked.peak_mb() < 100_000


def test_what_it_does_not_know_is_said(monkeypatch):
    with pytest.raises(UsageError, match=r"did you mean 'tools'"):
        measure(monkeypatch, "tool=3")
    with pytest.raises(UsageError, match="tools must be at least 1"):
        measure(monkeypatch, "tools=0")
    with pytest.raises(UsageError, match="pybulet"):
        measure(monkeypatch, "sim=pybulet")

"""On the processor, with a few worlds."""

import json
import sys

import pytest

from core.errors import UsageError, UserError
from tests.benchmarks import gpu

pytest.importorskip("mujoco_warp")


def measure(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["", *words])
    gpu.main()


def test_worlds_are_counted_and_compared(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    few = ("tasks=BringCube", "device=cpu", "worlds=2,4", "tools=2", "plans=2", "agreement=4")
    measure(monkeypatch, *few)
    found = json.loads((tmp_path / "gpu.json").read_text())
    assert [row["worlds"] for row in found["rows"]] == [2, 4]
    for row in found["rows"]:
        assert row["rollouts_per_s"] == pytest.approx(row["worlds"] / row["wall_s"])
        assert row["broken"] == 0
        assert row["making_s"] > 0
        assert row["planning_s"] > 0
    (compared,) = found["agreement"]
    assert compared["designs"] == 4
    assert compared["mean_difference"] < 0.05
    said = capsys.readouterr().out
    assert "| BringCube | 2 |" in said
    assert "| BringCube | 4 |" in said


def test_without_a_card_it_is_one_line(monkeypatch):
    import warp

    if warp.get_cuda_devices():
        pytest.skip("there is a card")
    with pytest.raises(UserError, match=r"no graphics card with CUDA is found here; sim\.device=cpu"):
        measure(monkeypatch, "tools=1", "plans=1")
    with pytest.raises(UsageError, match="worlds must be at least 1"):
        measure(monkeypatch, "worlds=0")

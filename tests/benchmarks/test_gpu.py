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
    page = tmp_path / "page.md"
    page.write_text("Before.\n<!-- gpu -->\n<!-- end of gpu -->\nAfter.\n")
    monkeypatch.chdir(tmp_path)
    few = ("tasks=BringCube", "device=cpu", "worlds=2,4", "tools=2", "plans=2", "agreement=4")
    measure(monkeypatch, *few, "page=page.md")
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
    assert "| BringCube | 4 |" in page.read_text()
    assert page.read_text().endswith("After.\n")
    assert "| BringCube | 2 |" in capsys.readouterr().out


def test_without_a_card_it_is_one_line(monkeypatch):
    import warp

    if warp.get_cuda_devices():
        pytest.skip("there is a card")
    with pytest.raises(UserError, match=r"no graphics card with CUDA is found here; sim\.device=cpu"):
        measure(monkeypatch, "tools=1", "plans=1")
    with pytest.raises(UsageError, match="worlds must be at least 1"):
        measure(monkeypatch, "worlds=0")

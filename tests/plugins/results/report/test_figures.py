"""The figures of rewards and tools, and the pieces that they are made of: bars are as high as the rewards."""

import re

import numpy as np
import pytest
from lxml import etree
from PIL import Image

from plugins.results.pages.figure import COLORS
from plugins.results.report.command import report
from tests.core.run_folders import write_run
from tests.plugins.results.report.test_tables import read_csv

FIGURES = {"rewards", "anytime"}


def test_figures_are_there_and_not_blank(made):
    data = made[0] / "out" / "data"
    drawn = {f.stem for f in data.glob("*.png")}
    assert drawn == {f.stem for f in data.glob("*.svg")} == FIGURES
    for file in data.glob("*.png"):
        picture = np.asarray(Image.open(file).convert("RGB"))
        assert min(picture.shape[:2]) > 200
        assert len(np.unique(picture[::3, ::3].reshape(-1, 3), axis=0)) > 20
        assert 0.01 < (picture != 255).any(axis=-1).mean() < 0.9


def test_bars_are_as_high_as_their_rewards(made):
    """Read back from the file: the heights of the full bars, over the height of the axis."""
    root, _, results = made
    svg = etree.parse(root / "out" / "data" / "rewards.svg")
    heights = {}
    for path in svg.iter("{*}path"):
        fill = re.search(r"fill: (#[0-9a-f]{6})", path.get("style", ""))
        if fill and fill.group(1).upper() in COLORS and "opacity" not in path.get("style"):
            corners = np.array(re.findall(r"[ML] ([\d.]+) ([\d.]+)", path.get("d")), dtype=float)
            heights.setdefault(fill.group(1).upper(), []).append(np.ptp(corners[:, 1]))
    averages = {m: [np.mean(g.rewards) for g in results.of(m)] for m in results.methods}
    bars = [heights[COLORS[i]][: len(averages[m])] for i, m in enumerate(results.methods)]
    ratio = np.concatenate(bars) / np.concatenate([averages[m] for m in results.methods])
    assert ratio == pytest.approx(np.full(len(ratio), ratio[0]), rel=1e-3)


@pytest.mark.thorough
def test_the_same_runs_give_the_same_report(made, tmp_path):
    root = made[0]
    report([root / "runs"], root / "again")
    files = [file for file in (root / "out").rglob("*") if file.is_file()]
    assert {file.suffix for file in files} == {".html", ".csv", ".png", ".svg"}
    for file in files:
        assert (root / "again" / file.relative_to(root / "out")).read_bytes() == file.read_bytes(), file.name


def test_one_run_is_enough_for_a_report(tmp_path):
    write_run(tmp_path / "run", rewards=[[0.5]])
    report([tmp_path / "run"], tmp_path / "out")
    drawn = {f.stem for f in (tmp_path / "out" / "data").glob("*.png")}
    assert drawn == {"rewards_by_generation"}
    assert read_csv(tmp_path / "out" / "data" / "methods.csv")[0]["IQM, low"] == ""


@pytest.mark.thorough
def test_more_methods_than_colours(tmp_path):
    for n in range(9):
        write_run(tmp_path / str(n), f"budget.n_agent={n + 1}", rewards=[[0.1 * n]])
    results = report([tmp_path], tmp_path / "out")
    assert len(results.methods) == 9
    assert "url(#h" in (tmp_path / "out" / "data" / "rewards.svg").read_text()  # hatched

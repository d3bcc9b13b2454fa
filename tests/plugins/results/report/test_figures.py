"""The figures of rewards: there, not blank, and the same each time."""

import numpy as np
import pytest
from PIL import Image

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


@pytest.mark.thorough
def test_the_same_runs_give_the_same_report(made, tmp_path):
    root = made[0]
    report([root / "runs"], root / "again")
    files = [file for file in (root / "out").rglob("*") if file.is_file()]
    assert {file.suffix for file in files} == {".html", ".csv", ".png", ".svg"}
    for file in files:
        assert (
            root / "again" / file.relative_to(root / "out")
        ).read_bytes() == file.read_bytes(), file.name


def test_one_run_is_enough_for_a_report(tmp_path):
    write_run(tmp_path / "run", rewards=[[0.5]])
    report([tmp_path / "run"], tmp_path / "out")
    drawn = {f.stem for f in (tmp_path / "out" / "data").glob("*.png")}
    assert drawn == {"rewards"}
    assert read_csv(tmp_path / "out" / "data" / "methods.csv")[0]["IQM, low"] == ""

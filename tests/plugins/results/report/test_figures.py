"""The figures of rewards: there, not blank, and the same each time."""

import numpy as np
import pytest
from PIL import Image

from plugins.results.pages.runs import find_runs
from plugins.results.report.figures import tied_groups
from plugins.results.report.report_command import report
from plugins.results.report.results import Results
from tests.core.run_folders import write_run

FIGURES = {"rewards", "on_some_tasks", "anytime", "by_generation"}


@pytest.mark.thorough
def test_figures_are_there_and_not_blank(made):
    data = made[0] / "out" / "data"
    drawn = {f.stem for f in data.glob("*.png")}
    assert drawn == {f.stem for f in data.glob("*.svg")} == FIGURES
    assert all(
        data.joinpath(f"{name}.pdf").read_bytes()[:4] == b"%PDF" for name in FIGURES
    )
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
    assert {file.suffix for file in files} == {".html", ".csv", ".png", ".svg", ".pdf"}
    for file in files:
        assert (
            root / "again" / file.relative_to(root / "out")
        ).read_bytes() == file.read_bytes(), file.name


def test_one_run_is_enough_for_a_report(tmp_path):
    write_run(tmp_path / "run", rewards=[[0.5]])
    report([tmp_path / "run"], tmp_path / "out")
    drawn = {f.stem for f in (tmp_path / "out" / "data").glob("*.png")}
    assert drawn == {"rewards"}
    # Over one task and one run there is nothing to add up.
    assert {f.stem for f in (tmp_path / "out" / "data").glob("m*.csv")} == set()


def test_distances_are_drawn_where_rewards_tie(tmp_path):
    write_run(tmp_path / "ours", rewards=[[0.9]])
    write_run(tmp_path / "sampled", "evolution=sampling", rewards=[[0.898]])
    write_run(tmp_path / "none", "tool=none", rewards=[[0.5]])
    write_run(tmp_path / "book", "task=OneBook", rewards=[[0.9]])
    results = Results(tuple(find_runs([tmp_path])[0]))
    tied = [(g.task, g.method.split()[-1]) for g in tied_groups(results)]
    assert sorted(tied) == [
        ("BringCube", "evolution=sampling"),
        ("BringCube", "evolution=vlmgineer"),
    ]

"""The figures of rewards: there, not blank, and the same each time."""

import numpy as np
import pytest
from PIL import Image

from plugins.results.pages.runs import find_runs
from plugins.results.report.figures import figure_pages
from plugins.results.report.report_command import report
from plugins.results.report.results import Results
from plugins.results.report.tables import tables
from tests.core.run_folders import write_run

FIGURES = {
    "rewards",
    "methods",
    "gains",
    "anytime",
    "by_generation",
}


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
    assert drawn == set()
    # Over one task and one run there is nothing to add up.
    assert {f.stem for f in (tmp_path / "out" / "data").glob("m*.csv")} == set()


def test_an_axis_begins_near_the_least_reward_unless_that_is_low(tmp_path):
    for seed, reward in enumerate((0.985, 0.99)):
        write_run(tmp_path / f"high{seed}", f"seed={seed}", rewards=[[reward]])
    assert axis_of(tmp_path)[0] == pytest.approx(0.98)
    write_run(tmp_path / "low", "seed=2", rewards=[[0.4]])
    assert axis_of(tmp_path)[0] == 0


def axis_of(folder):
    results = Results(tuple(find_runs([folder])[0]))
    (page,) = [p for p in figure_pages(results, tables(results)) if p.name == "rewards"]
    return page.paint().axes[0].get_xlim()


def test_methods_and_gains_are_drawn_where_there_are_several(tmp_path):
    for seed in (0, 1):
        write_run(tmp_path / f"a{seed}", f"seed={seed}", rewards=[[0.9 + 0.01 * seed]])
        words = ("evolution=sampling", f"seed={seed}")
        write_run(tmp_path / f"b{seed}", *words, rewards=[[0.7]])
    results = Results(tuple(find_runs([tmp_path])[0]))
    pages = {page.name: page for page in figure_pages(results, tables(results))}
    lines = [line.get_xdata() for line in pages["gains"].paint().axes[0].lines]
    assert any(
        0.2 in np.round(np.abs(line), 2) or 0.21 in np.round(np.abs(line), 2)
        for line in lines
    )
    assert len(pages["methods"].paint().axes[0].get_yticks()) == 2

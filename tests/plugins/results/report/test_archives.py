"""The map of an archive and its picks, from a run's store."""

import pytest

from plugins.results.pages.runs import read_run
from plugins.results.report.archives import heat_map, read_archive
from plugins.results.report.command import report
from tests.core.run_folders import edit, hook, write_run
from tests.plugins.results.conftest import QUICK
from tests.plugins.results.report.test_tables import read_csv

HOOKS = [hook(length, f"hook {1000 * length:.0f}") for length in (0.15, 0.25, 0.35, 0.36)]
REWARDS = [[0.2, 0.4, 0.7, 0.9], [0.5, None, 0.6, 0.1]]


def archive(folder, *words):
    folder = write_run(folder, "evolution=map_elites", *words, rewards=REWARDS, tools=HOOKS)
    return read_archive("BringCube", "map_elites", read_run(folder))


def test_each_cell_has_its_best_tool_and_picks_are_named(tmp_path):
    found = archive(tmp_path / "run")
    best = {kept.cell: (kept.evaluation.candidate.tool.name, kept.evaluation.reward) for kept in found.kept}
    # distances are 1.5 and 0.5 by turns
    assert best == {(3, 15): ("hook 150", 0.5), (6, 5): ("hook 250", 0.4), (8, 15): ("hook 350", 0.7),
                    (9, 5): ("hook 360", 0.9)}  # fmt: skip
    assert {kept.evaluation.candidate.id: kept.picked for kept in found.kept if kept.picked} == {
        "g0-a0-s3-p0": ("best", "light"),
        "g1-a0-s0-p0": ("plate",),
    }
    assert found.filled == 4


def test_a_tool_whose_plans_all_stopped_is_left_out(tmp_path):
    folder = tmp_path / "run"
    archive(folder)
    stopped = '{"trials": [{}], "combined": true, "planned": 2}'
    edit(folder, "UPDATE evaluations SET details = ? WHERE candidate = 'g0-a0-s3-p0'", stopped)
    found = read_archive("BringCube", "map_elites", read_run(folder))
    assert max(kept.evaluation.reward for kept in found.kept) == 0.7


def test_other_strategies_have_none(tmp_path):
    assert read_archive("BringCube", "", read_run(write_run(tmp_path / "run"))) is None


@pytest.mark.parametrize("measures", ["[mass]", "[components,extent,distance]"])
def test_maps_of_one_measure_and_of_three(tmp_path, measures):
    found = archive(tmp_path / "run", f"evolution.measures={measures}")
    assert len(heat_map(found, 1).render("png")) > 10_000


def test_a_report_shows_maps_and_picks(tmp_path):
    archive(tmp_path / "runs/a")
    archive(tmp_path / "runs/b", "task=OneBook")
    edit(tmp_path / "runs/b", "UPDATE strategies SET design = replace(design, 'tool_mount', 'nowhere')")
    report([tmp_path / "runs"], tmp_path / "out", ["svg"], QUICK)
    rows = read_csv(tmp_path / "out/data/archive.csv")
    assert [(row["pick"], row["tool"], row["cells filled"]) for row in rows] == [
        ("best, light", "hook 360", "4"),
        ("plate", "hook 150", "4"),
    ]
    page = (tmp_path / "out/index.html").read_text()
    assert 'id="figure-archive_1_' in page
    assert "archive of OneBook" in page  # why it is not shown
    assert [file.name[:20] for file in (tmp_path / "out/data").glob("archive_*.svg")] == ["archive_1_BringCube_"]

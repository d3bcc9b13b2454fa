"""The tables: their numbers are the runs'."""

import re

import numpy as np
import pytest

from core.interfaces import Felt, Looked
from plugins.results.best import save_events
from plugins.results.report.report_command import report
from tests.core.run_folders import edit, result, write_run
from tests.support.text import read_csv

pytestmark = pytest.mark.slow


def test_rewards_by_task_and_method_are_those_of_the_result_files(made):
    root, finished, _ = made
    rows = read_csv(root / "out" / "data" / "rewards.csv")
    assert len(rows) == 7
    stored = [result(folder) for folder in finished]
    for row in rows:
        method = re.match(r"tool=(\w+) evolution=(\w+) budget", row["method"])
        key = (row["task"], *method.groups())
        alike = [t for t in stored if (t["task"], t["tool"], t["evolution"]) == key]
        rewards = [t["best"]["reward"] for t in alike]
        best = alike[int(np.argmax(rewards))]["best"]
        assert int(row["runs"]) == len(alike) == 2
        assert float(row["best"]) == max(rewards)
        assert float(row["average"]) == pytest.approx(np.mean(rewards), abs=1e-15)
        assert float(row["standard deviation"]) == pytest.approx(
            np.std(rewards, ddof=1), abs=1e-15
        )
        assert float(row["distance of the best (m)"]) == best["measured"]["distance_m"]
        assert row["candidate"] == best["candidate"]


def test_runs_that_do_not_count_are_listed_and_nowhere_else(made):
    root, _, results = made
    rows = read_csv(root / "out" / "data" / "left_out.csv")
    assert {(r["status"], r["task"]) for r in rows} == {
        ("unfinished", "BringCube"),
        ("failed", "BringCube"),
    }
    assert "best reward so far 1.000" in str(rows)
    rewards = read_csv(root / "out" / "data" / "rewards.csv")
    assert max(float(r["best"]) for r in rewards) < 1
    assert sum(int(r["left out"]) for r in rewards) == 2
    assert len(results.runs) == 14


def test_figures_by_model(tmp_path):
    folder = tmp_path / "run"
    write_run(folder, rewards=[[0.2, 0.4, None], [0.5, 0.7, 0.9]], cost_usd=0.25)
    edit(folder, "UPDATE replies SET model = 'other' WHERE request_id = 'g1-a0'")
    edit(
        folder,
        "INSERT INTO requests (id, generation, agent, gripper, temperature, elites, digest, purpose)"
        """ VALUES ('g1-critic0', 1, 0, 0, 1.0, '["g0-a0-s1-p0"]', 'x', 'critiques')""",
    )
    edit(
        folder,
        "INSERT INTO replies (request_id, text, model, error, prompt_tokens, completion_tokens, cost_usd)"
        " VALUES ('g1-critic0', 'It slips.', 'other', NULL, 50, 5, 0.125)",
    )
    report([tmp_path], tmp_path / "out")
    rows = read_csv(tmp_path / "out" / "data" / "models.csv")
    names = "model|asked for|replies|of them failed|cost (USD)|candidates|could be tried (%)|best reward"
    shown = ["|".join(row[name] for name in names.split("|")) for row in rows]
    assert shown == [
        "a can|designs|1|0|0.25|3|66.66666666666667|0.4",
        "other|critiques|1|0|0.125|0||",
        "other|designs|1|0|0.25|3|100.0|0.9",
    ]
    assert float(rows[0]["mean reward"]) == pytest.approx((0.2 + 0.4) / 2)


def test_all_tables_are_written(made):
    data = made[0] / "out" / "data"
    names = "costs gains generations left_out methods rewards runs tools"
    # With one model and no critic, none of models.
    assert sorted(f.stem for f in data.glob("*.csv")) == names.split()


def test_the_page_lists_what_the_film_says_of_looks_and_guards(tmp_path):
    left = (("cube (goal 0)", ("cube",)),)
    looked = Looked(1, 1.5, 2, "round 1", ("<mark>",), left)
    felt = Felt(3, 2.25, "touch", 6.0)
    folder = tmp_path / "run"
    write_run(folder)
    best = folder / "best"
    best.mkdir(exist_ok=True)
    (best / "rollout.gif").write_bytes(b"GIF89a")
    save_events([looked, felt], best)
    report([folder], tmp_path / "out")

    rows = read_csv(tmp_path / "out" / "data" / "looks_and_guards.csv")
    assert [row["number"] for row in rows] == ["1", "2"]
    assert [row["what was seen or felt"] for row in rows] == [str(looked), str(felt)]
    page = (tmp_path / "out" / "index.html").read_text()
    assert "look 1 at 1.50 s, round 1: cube (goal 0): cube not in place" in page
    assert "hidden from the camera: &lt;mark&gt;" in page
    assert "waypoint 3: touch at 2.25 s, with 6.0 N at the flange" in page


def test_a_film_without_looks_and_guards_has_no_file_of_them(tmp_path):
    save_events([], tmp_path)
    assert not [*tmp_path.iterdir()]

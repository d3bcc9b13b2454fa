"""The tables about models: figures of each, and critiques as they came."""

from plugins.results.report.command import report
from tests.core.run_folders import edit, write_run
from tests.plugins.results.conftest import QUICK
from tests.plugins.results.report.test_tables import read_csv


def test_figures_by_model_and_critiques(tmp_path):
    folder = tmp_path / "run"
    write_run(folder, rewards=[[0.2, 0.4, None], [0.5, 0.7, 0.9]], cost_usd=0.25)
    edit(folder, "UPDATE replies SET model = 'other' WHERE request_id = 'g1-a0'")
    edit(
        folder,
        "INSERT INTO requests (id, generation, agent, gripper, temperature, elites, digest)"
        """ VALUES ('g1-critic0', 1, 0, 0, 1.0, '["g0-a0-s1-p0"]', 'x')""",
    )
    words = "=It slips. <script>alert(1)</script>"
    edit(
        folder,
        "INSERT INTO replies (request_id, text, model, error, prompt_tokens, completion_tokens, cost_usd)"
        " VALUES ('g1-critic0', ?, 'other', NULL, 50, 5, 0.125)",
        words,
    )
    report([tmp_path], tmp_path / "out", ["svg"], QUICK)
    first, second, critic = read_csv(tmp_path / "out" / "data" / "models.csv")
    names = ("model", "asked for", "replies", "of them failed", "cost (USD)", "could be tried (%)", "best reward")
    assert [first[name] for name in names] == ["a can", "designs", "1", "0", "0.25", str(200 / 3), "0.4"]
    assert float(first["mean reward"]) == (0.2 + 0.4) / 2
    assert [second[name] for name in names] == ["other", "designs", "1", "0", "0.25", "100.0", "0.9"]
    assert [critic[name] for name in names] == ["other", "critiques", "1", "0", "0.125", "", ""]
    (critique,) = read_csv(tmp_path / "out" / "data" / "critiques.csv")
    assert (critique["candidate"], float(critique["reward"])) == ("g0-a0-s1-p0", 0.4)
    assert critique["critique"] == f"'{words}"  # no formula
    page = (tmp_path / "out" / "index.html").read_text()
    assert "Models and critics" in page
    assert "<script>alert" not in page


def test_one_model_without_a_critic_needs_no_table(made):
    root, _, _ = made
    assert not (root / "out" / "data" / "models.csv").exists()
    assert not (root / "out" / "data" / "critiques.csv").exists()

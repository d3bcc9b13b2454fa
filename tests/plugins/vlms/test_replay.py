"""A past run's replies give the past run's result."""

import json
import sqlite3

import pytest

from core.config.compose import load
from core.errors import UsageError, UserError
from core.plugins import installed
from core.search.orchestration import run

SMALL = [
    "budget.n_agent=2",
    "budget.n_tool=1",
    "budget.n_action=2",
    "budget.n_iteration=1",
    "film=false",
    "listener={}",
]


def result(folder, *overrides):
    run(load("config", ["executor.workers=1", *SMALL, *overrides]), folder)
    found = json.loads((folder / "result.json").read_text())
    return {key: value for key, value in found.items() if key not in ("wall_time_s", "rollouts_per_s", "vlm")}


@pytest.mark.slow
def test_same_result_as_the_past_run(tmp_path):
    past = result(tmp_path / "past", "vlm=offline")
    assert past["best"]["reward"] > 0
    again = result(tmp_path / "again", "vlm=replay", f"vlm.run={tmp_path / 'past'}")
    assert again == past
    with sqlite3.connect(tmp_path / "again" / "run.sqlite") as database:
        models = {row[0] for row in database.execute("SELECT model FROM replies")}
    assert models == {"offline (embedded designer, no language model)"}


@pytest.mark.slow
def test_requests_without_a_past_reply_are_rejected(tmp_path):
    result(tmp_path / "past", "vlm=offline", "budget.n_iteration=0", "budget.n_agent=1")
    longer = result(tmp_path / "again", "vlm=replay", f"vlm.run={tmp_path / 'past'}")
    first, second = longer["generations"]
    assert (first["n_candidates"], first["n_rejected"]) == (3, 1)
    assert (second["n_candidates"], second["n_rejected"]) == (2, 2)


def test_mistakes_are_errors(tmp_path):
    with pytest.raises(UsageError, match=r"vlm\.run is empty"):
        installed().create("vlm", "replay")
    with pytest.raises(UserError, match=r"vlm\.run: .* there is no run\.sqlite"):
        installed().create("vlm", "replay", {"run": str(tmp_path)})
    (tmp_path / "run.sqlite").write_text("this is no database, but it is long enough to be taken for one" * 20)
    with pytest.raises(UserError, match=r"vlm\.run: .*can't be read: file is not a database"):
        installed().create("vlm", "replay", {"run": str(tmp_path)})

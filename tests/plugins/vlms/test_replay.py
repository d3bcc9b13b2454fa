"""A past run's replies give the past run's result."""

import json
import sqlite3
from types import SimpleNamespace

import pytest

from core.config.compose import load
from core.errors import UsageError, UserError
from core.plugins import installed
from core.search.orchestration import run

SMALL = [
    *("sim=mujoco", "film=false", "listener={}", "prompt.picture=false"),
    *(
        "budget=tiny",
        "budget.n_agent=2",
        "budget.n_iteration=1",
    ),
]


def result(folder, *overrides):
    run(load("config", [*SMALL, *overrides]), folder)
    found = json.loads((folder / "result.json").read_text())
    return {
        key: value
        for key, value in found.items()
        if key not in ("wall_time_s", "rollouts_per_s", "vlm")
    }


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.usefixtures("inline")
def test_the_same_result_as_the_past_run_and_requests_that_it_lacks(tmp_path):
    past = result(tmp_path / "past", "vlm=offline")
    assert past["best"]["reward"] > 0
    again = result(tmp_path / "again", "vlm=replay", f"vlm.run={tmp_path / 'past'}")
    assert again == past
    with sqlite3.connect(tmp_path / "again" / "run.sqlite") as database:
        models = {row[0] for row in database.execute("SELECT model FROM replies")}
    assert models == {"offline (embedded designer, no language model)"}
    more = result(
        tmp_path / "more",
        "vlm=replay",
        f"vlm.run={tmp_path / 'past'}",
        "budget.n_agent=3",
    )
    assert [(g["n_candidates"], g["n_rejected"]) for g in more["generations"]] == [
        (3, 1),
        (3, 1),
    ]


def test_a_file_answers_each_request(tmp_path):
    file = tmp_path / "answer.md"
    file.write_text("So: one cube.")
    vlm = installed().create("vlm", "replay", {"run": str(file)})
    requests = [SimpleNamespace(id=name) for name in ("scene-1", "scene-2")]
    replies = list(vlm.complete(requests))
    assert [reply.request_id for reply in replies] == ["scene-1", "scene-2"]
    assert {reply.text for reply in replies} == {"So: one cube."}
    assert str(file) in vlm.model


def test_mistakes_are_errors(tmp_path):
    with pytest.raises(UsageError, match=r"vlm\.run is empty"):
        installed().create("vlm", "replay")
    with pytest.raises(UserError, match=r"vlm\.run: .* there is no run\.sqlite"):
        installed().create("vlm", "replay", {"run": str(tmp_path)})
    (tmp_path / "run.sqlite").write_text(
        "this is no database, but it is long enough to be taken for one" * 20
    )
    with pytest.raises(
        UserError, match=r"vlm\.run: .*can't be read: file is not a database"
    ):
        installed().create("vlm", "replay", {"run": str(tmp_path)})

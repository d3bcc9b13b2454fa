"""A run that was cut short goes on: what was asked is not asked again, what was tried is not tried again, and it comes
to what it would have come to.
"""

import json
import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from core.database import FILE
from core.plugins import installed
from tests import toys

ROOT = Path(__file__).parents[1]
POINTS = int(os.environ.get("VLMGINEER_KILLS", "25"))
TIMES = ("wall_time_s", "rollouts_per_s")


@pytest.fixture
def toy(monkeypatch):
    """The toys can be had by name."""
    offers = dict(installed().offers)
    monkeypatch.setattr(installed(), "offers", offers)
    toys.offer(installed())


def result_of(folder):
    return {k: v for k, v in json.loads((folder / "result.json").read_text()).items() if k not in TIMES}


def rows(file, query):
    with closing(sqlite3.connect(file)) as database:
        return database.execute(query).fetchall()


def tables(folder):
    """All that is stored, but for times."""
    names = [name for (name,) in rows(folder / FILE, "SELECT name FROM sqlite_master WHERE type = 'table'")]
    assert len(names) > 6
    found = {name: sorted(rows(folder / FILE, f"SELECT * FROM {name}"), key=repr) for name in names}
    assert found.pop("sessions")
    ((version, config, result),) = found.pop("run")
    found["run"] = version, json.loads(config), {k: v for k, v in json.loads(result).items() if k not in TIMES}
    return found


def plain_files(folder):
    """By name; without what has times or locks in it."""
    files = {path.relative_to(folder): path for path in folder.rglob("*") if path.is_file()}
    left_out = ("run.", "result.json", ".hydra", "recording")
    return {name: path.read_bytes() for name, path in files.items() if not str(name).startswith(left_out)}


def assert_same_run(one, other):
    assert result_of(one) == result_of(other)
    found, expected = tables(one), tables(other)
    for config in (found["run"][1], expected["run"][1]):
        for kind in ("vlm", "executor"):
            config[kind].pop("notes", None)
    assert found == expected
    assert plain_files(one) == plain_files(other)
    assert not list(one.rglob("*.part"))


# --- killed at any moment ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("kills")
    command = [sys.executable, "-m", "tests.kills", str(folder), str(POINTS)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=1200)
    assert done.returncode == 0, done.stderr
    return folder


def test_a_run_killed_at_any_moment_comes_to_the_same_end(killed):
    assert result_of(killed / "whole" / "run")["best"]["generation"] == 1
    for point in range(POINTS):
        assert_same_run(killed / str(point) / "run", killed / "whole" / "run")


def test_what_is_stored_is_neither_asked_nor_tried_again(killed):
    stored = []
    for point in range(POINTS):
        at = killed / str(point)
        first, *later = (at / "notes").read_text().removeprefix("session\n").split("session\n")
        before = set(first.split("\n"))
        after = "".join(later).split("\n")
        if not (at / "killed" / FILE).exists() or not rows(at / "killed" / FILE, "SELECT name FROM sqlite_master"):
            stored.append(0)
            continue
        replies = rows(at / "killed" / FILE, "SELECT request_id FROM replies")
        evaluations = rows(at / "killed" / FILE, "SELECT content FROM evaluations WHERE status != 'rejected'")
        known = {f"asked {request}" for (request,) in replies} | {f"tried {content}" for (content,) in evaluations}
        assert known <= before
        assert not known & set(after)
        stored.append(len(known))
    assert stored == sorted(stored)  # the moments are spread over the run's life
    assert len(set(stored)) > min(POINTS, 25) / 3

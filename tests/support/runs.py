"""Runs with toys, and what is compared of two of them."""

import json
import sqlite3
from contextlib import closing

import pytest

from core.plugins import installed
from core.store.database import FILE
from tests.support import toys

TIMES = ("wall_time_s", "rollouts_per_s")


# Settings that may differ between sessions.
LOCAL = ("notes", "members", "limit", "down", "fails_at", "workers")


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """The toys can be had by name; their notes."""
    monkeypatch.setattr(installed(), "offers", dict(installed().offers))
    toys.offer(installed())
    return toys.Notes(str(tmp_path / "notes"))


def result_of(folder):
    return {
        k: v
        for k, v in json.loads((folder / "result.json").read_text()).items()
        if k not in TIMES
    }


def rows(file, query):
    with closing(sqlite3.connect(file)) as database:
        return database.execute(query).fetchall()


def tables(folder):
    """All that is stored, but for times."""
    names = [
        name
        for (name,) in rows(
            folder / FILE, "SELECT name FROM sqlite_master WHERE type = 'table'"
        )
    ]
    assert len(names) > 6
    found = {
        name: sorted(rows(folder / FILE, f"SELECT * FROM {name}"), key=repr)
        for name in names
    }
    assert found.pop("sessions")
    _name_trials(found)
    ((version, config, result),) = found.pop("run")
    config = json.loads(config)
    config.pop("patience_s", None)
    for kind in ("vlm", "executor"):
        config[kind] = {
            key: value for key, value in config[kind].items() if key not in LOCAL
        }
    found["run"] = (
        version,
        config,
        {key: value for key, value in json.loads(result).items() if key not in TIMES},
    )
    return found


def _name_trials(found):
    """Name trials by what was tried where.

    The numbers of their rows are those of their arrival, and of equal designs the one that came first was played.
    """
    names = {number: name for number, *name, _, _, _, _ in found["trials"]}
    found["trials"] = sorted((row[1:6] + row[7:] for row in found["trials"]), key=repr)
    evaluations = []
    for *columns, details in found["evaluations"]:
        known = json.loads(details)
        known |= {
            key: [names[number] for number in known[key]]
            for key in ("trials", "finals")
        }
        evaluations.append((*columns, known))
    found["evaluations"] = evaluations


def plain_files(folder):
    """By name; without what has times or locks in it."""
    files = {
        str(path.relative_to(folder)): path
        for path in folder.rglob("*")
        if path.is_file()
    }
    left_out = ("run.", "result.json", ".hydra", "recording")
    return {
        name: path.read_bytes()
        for name, path in files.items()
        if not name.startswith(left_out)
    }


def assert_same_run(one, other):
    assert result_of(one) == result_of(other)
    assert tables(one) == tables(other)
    assert plain_files(one) == plain_files(other)
    assert not list(one.rglob("*.part"))

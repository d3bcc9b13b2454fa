"""Stores that somebody made to hang, fill or mislead whoever reads them."""

import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest

from core.errors import UserError
from core.search.orchestration import resume
from core.store import database
from core.store.database import FILE
from core.store.reader import StoredRun
from core.support import sandbox
from plugins.results.pages.runs import read_run
from tests.core.run_folders import write_run

ENDLESS = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c)"
REPLACED = {
    "a view without end": [
        "ALTER TABLE evaluations RENAME TO others",
        f"CREATE VIEW evaluations AS {ENDLESS} SELECT others.* FROM others, c",
    ],
    "a view that ends": ["CREATE VIEW more AS SELECT * FROM trials"],
    "a trigger": [
        f"CREATE TRIGGER t AFTER INSERT ON sessions BEGIN {ENDLESS} SELECT count(*) FROM c; END"
    ],
    "a virtual table": ["CREATE VIRTUAL TABLE text USING fts5(a)"],
    "a computed column": [
        "ALTER TABLE trials ADD COLUMN big AS (hex(zeroblob(50000000)))"
    ],
    "a view that says that it is a table": [
        f"CREATE VIEW t AS {ENDLESS} SELECT x FROM c",
        "PRAGMA writable_schema = ON",
        "UPDATE sqlite_master SET type = 'table' WHERE name = 't'",
    ],
}


@pytest.fixture(scope="module")
def honest(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("run") / "run", rewards=[[0.3, 0.5]])


def alter(folder, statements):
    with closing(sqlite3.connect(folder / FILE)) as store:
        for statement in statements:
            store.execute(statement)
        store.commit()


@pytest.mark.parametrize("statements", REPLACED.values(), ids=REPLACED)
def test_a_store_that_computes_is_refused_at_every_door(honest, tmp_path, statements):
    folder = shutil.copytree(honest, tmp_path / "run")
    alter(folder, statements)
    doors = (
        StoredRun(folder).config,
        StoredRun(folder).evaluations,
        lambda: resume(folder),
    )
    for door in doors:
        with pytest.raises(
            UserError, match=r"can't be read: .*(tables|computed|schema)"
        ):
            door()
    assert read_run(folder).status == "unreadable"


def test_an_index_of_ones_own_does_no_harm(honest, tmp_path):
    folder = shutil.copytree(honest, tmp_path / "run")
    alter(folder, ["CREATE INDEX best ON evaluations (reward)"])
    assert len(StoredRun(folder).evaluations()) == 2


def test_rows_and_bytes_have_bounds(honest, monkeypatch):
    for name, few, many in (("MOST_ROWS", 1, 2), ("MOST_FILE", 1000, 10**6)):
        with monkeypatch.context() as patch:
            patch.setattr(database, "_sound", set())
            patch.setattr(database, name, few)
            with pytest.raises(UserError, match="has more than"):
                StoredRun(honest).trials()
        with monkeypatch.context() as patch:
            patch.setattr(database, "_sound", set())
            patch.setattr(database, name, many)
            assert len(StoredRun(honest).trials()) == 2


def test_a_large_store_is_read_in_a_process_with_limits_first(
    honest, monkeypatch, tmp_path
):
    monkeypatch.setattr(database, "ALONE", 1000)
    monkeypatch.setattr(database, "_sound", set())
    assert len(StoredRun(honest).trials()) == 2

    monkeypatch.setattr(database, "_sound", set())
    monkeypatch.setattr(sandbox, "LIMIT_S", 0.01)
    with pytest.raises(UserError, match="takes more than"):
        StoredRun(honest).trials()

    monkeypatch.setattr(sandbox, "LIMIT_S", 600)
    damaged = shutil.copytree(honest, tmp_path / "run")
    alter(damaged, ["UPDATE trials SET details = '['"])
    with pytest.raises(UserError, match="can't be read"):
        StoredRun(damaged).trials()


def test_a_statement_is_ended_by_its_time(honest, monkeypatch):
    monkeypatch.setattr(database, "MOST_S", 0.2)
    query = f"{ENDLESS} SELECT count(*) FROM c"
    with (
        pytest.raises(UserError, match="interrupted"),
        database.reading(honest) as store,
    ):
        store.execute(query)


SLOW = f"""
import sys
from pathlib import Path
from core.store import database
from core.support.cli import command

def main(words):
    with database.reading(Path(words[0])) as store:
        print("begins", flush=True)
        store.execute("{ENDLESS} SELECT count(*) FROM c")

command(main)
"""


def test_a_signal_ends_a_statement(honest):
    process = subprocess.Popen(
        [sys.executable, "-c", SLOW, str(honest)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(Path.cwd())},
    )
    assert process.stdout.readline() == b"begins\n"
    time.sleep(0.3)
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=60)
    assert process.returncode in (1, 130)
    assert b"interrupted" in said


def test_a_store_that_is_a_link_is_not_followed(honest, tmp_path):
    (tmp_path / FILE).symlink_to(honest / FILE)
    with pytest.raises(UserError, match="is no regular file"):
        StoredRun(tmp_path).config()

"""Stores whose content was damaged: the schema finds what no run writes."""

import json
import sqlite3
from contextlib import closing

import pytest

from core.errors import UserError
from core.search.run_settings import stored_config
from core.store.recorder import RunStore
from plugins.results.pages.runs import read_run
from tests.core.run_folders import edit, write_run

pytestmark = pytest.mark.slow

DEEP = "[" * 9000 + "]" * 9000


def said_of(folder):
    """The line of each door: of a report, a resume, a transfer and a replay."""
    run = read_run(folder)
    assert run.status == "unreadable"
    lines = [run.reason]
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    for door in (RunStore.open, stored_config):
        with pytest.raises(UserError) as error:
            door(folder)
        lines.append(str(error.value))
    assert {
        path: path.read_bytes() for path in folder.rglob("*") if path.is_file()
    } == before
    assert not any("\n" in line for line in lines)
    return lines


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE run SET schema_version = 4",
        "ALTER TABLE evaluations DROP COLUMN details",
    ],
)
def test_a_store_of_another_form_is_refused_in_one_line_and_left_as_it_is(
    tmp_path, statement
):
    folder = write_run(tmp_path / "run")
    edit(folder, statement)
    data = (folder / "run.sqlite").read_bytes()
    said = "written by another version" if "4" in statement else "details: is missing"
    assert all(said in line for line in said_of(folder))
    for _ in range(2):  # the lock is free again
        with pytest.raises(UserError, match=said) as refused:
            RunStore.open(folder)
        assert "\n" not in str(refused.value)
    assert (folder / "run.sqlite").read_bytes() == data


@pytest.mark.parametrize(
    ("statement", "value", "said"),
    [
        (
            "UPDATE evaluations SET reason = ?",
            "x" * 2_000_001,
            "reason: has 2,000,001 characters, of at most 2,000,000",
        ),
        (
            "UPDATE evaluations SET reward = ?",
            1e308,
            "reward: must be less than or equal to 1",
        ),
        (
            "UPDATE evaluations SET reward = ?",
            "much",
            "reward: must be a number",
        ),
        (
            "UPDATE evaluations SET distance_m = ?",
            float("inf"),
            "distance_m: must be a finite number",
        ),
        (
            "UPDATE evaluations SET status = ?",
            "done",
            "status: must be 'ok', 'rejected' or 'failed'",
        ),
        (
            "UPDATE evaluations SET waypoints = ?",
            "[[1, 2, 3]]",
            "must have at least 6 items",
        ),
        ("UPDATE evaluations SET waypoints = ?", "[1, 2, 3, 4, 5, 6]", "waypoints."),
        (
            "UPDATE evaluations SET waypoints = ?",
            '[["a", 2, 3, 4, 5, 6]]',
            "waypoints.",
        ),
        (
            "UPDATE evaluations SET waypoints = ?",
            '[{"offset": [1, 2, 3]}]',
            "waypoints.",
        ),
        ("UPDATE evaluations SET waypoints = ?", '{"plan": []}', "waypoints."),
        ("UPDATE evaluations SET waypoints = ?", "[[", "waypoints: Invalid JSON"),
        (
            "UPDATE evaluations SET plan = ?",
            -1,
            "plan: must be greater than or equal to 0",
        ),
        (
            "UPDATE evaluations SET details = ?",
            DEEP,
            "details: Invalid JSON: recursion limit exceeded",
        ),
        ("UPDATE evaluations SET details = ?", b"\xff", "details: "),
        (
            "UPDATE evaluations SET details = ?",
            '{"score": {"reward": 2}, "trials": {}}',
            "details.trials: ",
        ),
        (
            "UPDATE evaluations SET details = ?",
            '{"score": {}, "trials": [1]}',
            "details.score.reward: is missing",
        ),
        (
            "UPDATE evaluations SET details = ?",
            '{"score": {"reward": 1, "shown": 1}, "trials": [1], "finals": []}',
            "details: there is no trial 1 to show",
        ),
        (
            "UPDATE evaluations SET details = ?",
            '{"score": {"reward": 1}, "trials": [1], "finals": [99]}',
            "evaluations: trial 99 of g0-a0-s0-p0 has no row in trials",
        ),
        (
            "DELETE FROM trials WHERE number = ?",
            2,
            "evaluations: trial 2 of g0-a0-s1-p0 has no row in trials",
        ),
        (
            "UPDATE trials SET details = ?",
            '{"observation": {"result": "lost"}}',
            "observation.result: must be",
        ),
        (
            "UPDATE trials SET details = ?",
            '{"moved_m": {"cube": "far"}}',
            "moved_m.cube: must be a numb",
        ),
        ("UPDATE trials SET details = ?", DEEP, "recursion limit exceeded"),
        (
            "UPDATE trials SET status = ?",
            "done",
            "status: must be 'ok', 'rejected' or 'failed'",
        ),
        (
            "UPDATE trials SET layout = ?",
            "first",
            "where.2: must be a whole number",
        ),
        ("UPDATE designs SET written = ?", "[]", "written: "),
        (
            "UPDATE designs SET written = ?",
            '{"tool_urdf": ""}',
            "written.gripper: is missing",
        ),
        ("UPDATE designs SET parents = ?", '{"a": 1}', "parents: "),
        (
            "DELETE FROM designs WHERE design = ?",
            1,
            "evaluations: g0-a0-s1-p0 has no row in designs",
        ),
        (
            "UPDATE replies SET prompt_tokens = ?",
            2**63 - 1,
            "prompt_tokens: must be less than",
        ),
        (
            "UPDATE replies SET text = CAST(? AS TEXT)",
            b"two\nlines \xff\xfe",
            "Could not decode to UTF-8",
        ),
        ("UPDATE requests SET gripper = ?", 7, "gripper: "),
        ("UPDATE sessions SET versions = ?", "[1]", "versions: "),
        ("UPDATE run SET config = ?", "3", "config: "),
        ("UPDATE run SET config = ?", '{"task": {}}', "config: task has no name"),
        (
            "UPDATE run SET config = ?",
            '{"budget": {"n_agent": [1]}}',
            "config.budget.n_agent: ",
        ),
        ("UPDATE run SET result = ?", '{"name": "", "task": 1}', "result.task: "),
        ("DROP TABLE sessions", None, "no such table: sessions"),
    ],
)
def test_values_that_no_run_writes(tmp_path, statement, value, said):
    folder = write_run(tmp_path / "run")
    if statement.startswith("DROP"):
        with closing(sqlite3.connect(folder / "run.sqlite")) as database:
            database.execute(statement)
    else:
        edit(folder, statement, *([] if value is None else [value]))
    assert all(said in line for line in said_of(folder))


def test_an_index_that_does_not_fit_its_table_is_damage(tmp_path):
    """Each of its rows can be read."""
    folder = write_run(tmp_path / "run")
    query = "SELECT rootpage FROM sqlite_master WHERE name = ?"
    change = "UPDATE sqlite_master SET rootpage = ? WHERE name = ?"
    requests = "sqlite_autoindex_requests_1"
    evaluations = "sqlite_autoindex_evaluations_1"
    with closing(sqlite3.connect(folder / "run.sqlite")) as store:
        store.execute("PRAGMA writable_schema = ON")
        (page,) = store.execute(query, (requests,)).fetchone()
        store.execute(change, (page, evaluations))
        store.commit()
    assert all("can't be read: " in line for line in said_of(folder))


def test_the_rows_that_are_deleted_are_asked_and_tried_again(tmp_path):
    """The mend that the message names."""
    folder = write_run(tmp_path / "run")
    edit(folder, "DELETE FROM replies WHERE request_id = 'g0-a0'")
    store = RunStore.open(folder)
    assert json.loads(json.dumps(store.config)) == store.config
    assert set(store.past.replies) == {"g1-a0"}
    store.run_ended()

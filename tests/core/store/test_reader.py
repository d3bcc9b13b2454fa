"""The reader of a store: requests, designs and evaluations as values."""

import pytest

from core.errors import UserError
from core.search.run_settings import stored_config
from core.store.reader import StoredRun
from core.values.messages import Bill
from tests.core.run_folders import edit, write_run


def test_a_run_is_read_as_values(tmp_path):
    store = StoredRun(
        write_run(tmp_path, rewards=[[0.2, None], [0.5, 0.5]], cost_usd=0.25)
    )
    assert store.config()["budget"]["name"] == "quick"
    assert store.result().best.reward == 0.5
    assert store.seconds() > 0
    assert [(e.candidate, e.status, e.reward) for e in store.evaluations()] == [
        ("g0-a0-s0-p0", "ok", 0.2),
        ("g0-a0-s1-p0", "rejected", 0.0),
        ("g1-a0-s0-p0", "ok", 0.5),
        ("g1-a0-s1-p0", "ok", 0.5),
    ]
    assert {
        key: design.parents for key, design in store.designs().items() if design.parents
    } == {
        (1, 0, 0): ("g0-a0-s0-p0",),
        (1, 0, 1): ("g0-a0-s0-p0",),
    }
    assert [len(e.plan) for e in store.evaluations()] == [2] * 4
    assert Bill.of([reply for _, reply in store.answers()]) == (
        *(2, 0, 200, 20),
        *(0.5, None, None),
    )


def test_requests_come_with_their_replies_and_those_without_one_too(tmp_path):
    store = StoredRun(write_run(tmp_path, rewards=[[0.2], [0.5]]))
    edit(
        tmp_path,
        "UPDATE requests SET id = 'g1-critic0', purpose = 'critiques'"
        """, elites = '["g0-a0-s0-p0"]' WHERE generation = 1""",
    )
    unanswered, answered = store.requests()
    assert (unanswered.purpose, unanswered.elites, unanswered.reply) == (
        "critiques",
        ("g0-a0-s0-p0",),
        None,
    )
    assert (answered.id, answered.purpose, answered.reply.text) == (
        "g0-a0",
        "designs",
        "{}",
    )
    assert store.answers() == [(answered, answered.reply)]
    assert Bill.of([]) == (0, 0, None, None, None, None, None)


def test_a_trial_that_candidates_share_counts_once(tmp_path):
    store = StoredRun(write_run(tmp_path, rewards=[[0.2, 0.2, None]]))
    assert [e.rollouts for e in store.evaluations()] == [1, 1, 0]
    edit(tmp_path, "UPDATE trials SET candidate = 'g0-a0-s0-p0'")
    assert [e.rollouts for e in store.evaluations()] == [1, 0, 0]


def test_a_run_that_was_killed_at_once_and_one_of_another_version(tmp_path):
    store = StoredRun(write_run(tmp_path, rewards=[]))
    edit(tmp_path, "UPDATE run SET schema_version = 0")
    with pytest.raises(UserError, match="written by another version"):
        store.config()
    edit(tmp_path, "DELETE FROM run")
    assert (store.exists, store.config(), store.result()) == (True, {}, None)
    with pytest.raises(UserError, match="its store is empty"):
        stored_config(tmp_path)
    assert not StoredRun(tmp_path / "elsewhere").exists

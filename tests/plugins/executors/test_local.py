import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from core.errors import Fault, UserError
from core.interfaces import CHUNK
from core.plugins import installed
from core.support.scratch import scratch
from tests.support.chunks import double, misfortune
from tests.support.processes import all_gone, living

pytestmark = pytest.mark.slow


def executor(**settings):
    return installed().create("executor", "local", settings)


# What workers do: functions of a module, so that they can travel.


def who(chunk):
    time.sleep(0.05)
    return os.getpid()


def refuse(*arguments):
    os._exit(7)


@pytest.mark.parametrize("workers", [1, 2])
def test_each_chunk_comes_with_its_result(workers):
    chunks = [[i, i + 1] for i in range(7)]
    with executor(workers=workers) as pool:
        found = list(pool.map(double, chunks))
        again = list(pool.map(double, chunks[:2]))
    assert sorted(found) == [(chunk, [2 * x for x in chunk]) for chunk in chunks]
    assert len(again) == 2
    # The very chunk, not a copy that travelled.
    assert all(any(chunk is own for own in chunks) for chunk, _ in found)


def test_what_befalls_a_chunk_befalls_no_other():
    chunks = [
        ["a"],
        ["raise"],
        ["b"],
        ["exit"],
        ["c"],
        ["kill"],
        ["d"],
        ["hang"],
        ["e"],
    ]
    with executor(workers=2, timeout_s=3.0) as pool:
        found = {chunk[0]: result for chunk, result in pool.map(misfortune, chunks)}
        assert list(pool.map(double, [[1]])) == [([1], [2])]  # and the pool goes on
    assert {name: found[name] for name in "abcde"} == {name: [name] for name in "abcde"}
    assert isinstance(found["raise"], ValueError)
    assert str(found["raise"]) == "this chunk is bad"
    assert "died" in str(found["exit"])
    assert "3" in str(found["exit"])
    assert "died" in str(found["kill"])
    assert isinstance(found["kill"], Fault)
    assert not isinstance(found["exit"], Fault)
    assert "executor.timeout_s" in str(found["hang"])
    assert all(isinstance(found[name], Exception) for name in ("exit", "kill", "hang"))


@pytest.mark.parametrize(
    ("fate", "why"),
    [
        ("leave", "died (exit code 0)"),
        ("system exit", "SystemExit: enough"),
        ("unreadable", "Unreadable: a and b"),
    ],
)
def test_a_chunk_that_ends_its_worker_in_an_odd_way_is_not_waited_for(fate, why):
    """A pool that expects no exit code 0, or an exception that can't travel, would wait for ever."""
    with executor(workers=1) as pool:
        found = {
            chunk[0]: result
            for chunk, result in pool.map(misfortune, [["a"], [fate], ["b"]])
        }
    assert found["a"] == ["a"]
    assert found["b"] == ["b"]
    assert isinstance(found[fate], Exception)
    assert why in str(found[fate])


@pytest.mark.thorough
def test_a_worker_that_dies_while_it_has_no_work_breaks_nothing():
    """As when the machine is out of memory while a model is thinking: the pools of openevolve #246 and #395 broke."""
    with executor(workers=2) as pool:
        for pid in {pid for _, pid in pool.map(who, [[i] for i in range(8)])}:
            os.kill(pid, signal.SIGKILL)
        assert sorted(pool.map(double, [[1], [2], [3]])) == [
            ([1], [2]),
            ([2], [4]),
            ([3], [6]),
        ]


def test_processes_that_cannot_be_used_end_the_run(monkeypatch):
    monkeypatch.setattr("plugins.executors.local._work", refuse)
    with executor(workers=2) as pool, pytest.raises(UserError, match="exit code 7"):
        list(pool.map(double, [[1], [2]]))


PARENT = """
import os, signal, sys, time
from core.plugins import installed
from tests.support.chunks import misfortune
from tests.plugins.executors.test_local import who

if __name__ == "__main__":
    pool = installed().create("executor", "local", {"workers": 2})
    results = pool.map(who, ([i] for i in range(6)))
    print(*{pid for _, pid in results}, flush=True)
    for _ in pool.map(misfortune, [["hang"], ["hang"]]):
        pass
"""


def test_workers_do_not_outlive_a_process_that_was_killed(tmp_path):
    (tmp_path / "parent.py").write_text(PARENT)
    parent = subprocess.Popen(
        [sys.executable, tmp_path / "parent.py"], stdout=subprocess.PIPE, text=True
    )
    workers = [int(pid) for pid in parent.stdout.readline().split()]
    assert workers
    assert set(workers) <= set(living())
    parent.kill()
    parent.wait()
    assert all_gone(workers)


def test_a_worker_takes_no_notice_of_an_interrupt():
    """Ctrl-C reaches every process at the terminal; what it means is for the main one to say."""
    with executor(workers=1) as pool:
        ((_, pid),) = pool.map(who, [[0]])
        os.kill(pid, signal.SIGINT)
        assert list(pool.map(who, [[0]])) == [([0], pid)]


class Batching:
    batch = 100

    def __call__(self, chunk):
        return who(chunk)


def test_one_worker_serves_an_engine_that_batches_unless_more_are_asked_for():
    with executor(workers=None) as pool:
        assert (
            len({pid for _, pid in pool.map(Batching(), [[i] for i in range(4)])}) == 1
        )
        assert len(pool._pool) == 1
    with executor(workers=2) as pool:
        list(pool.map(Batching(), [[0]]))
        assert len(pool._pool) == 2


def test_closing_ends_the_workers():
    with executor(workers=2) as pool:
        processes = {pid for _, pid in pool.map(who, [[i] for i in range(8)])}
        assert os.getpid() not in processes
        assert processes <= set(living())
        assert len(processes) <= 2
    assert not processes & set(living())


def test_closing_waits_for_nobody():
    with executor(workers=1) as pool:
        results = pool.map(misfortune, [["a"], ["hang"]])
        assert next(results) == (["a"], ["a"])
        began = time.monotonic()
    assert time.monotonic() - began < 5


def hoard(chunk):
    """Takes so many megabytes for good."""
    held.extend(bytearray(2**20) for _ in range(chunk[0]))
    return len(held)


held = []


def test_a_worker_gets_no_more_memory_than_is_allowed():
    with executor(workers=1, memory_mb=600) as pool:
        ((_, much),) = pool.map(hoard, [[2000]])
        assert "executor.memory_mb=600" in str(much)
        assert [result for _, result in pool.map(hoard, [[200]])] == [200]


@pytest.mark.thorough
def test_what_others_left_in_a_worker_is_no_chunks_fault():
    """Each takes less than is allowed; together they take more."""
    with executor(workers=1, memory_mb=600) as pool:
        results = [result for _, result in pool.map(hoard, [[200]] * 6)]
    assert all(isinstance(result, int) for result in results)
    assert max(results) < 600


@pytest.mark.thorough
def test_the_candidates_of_a_chunk_have_as_long_as_one():
    with executor(workers=1, timeout_s=2.0) as pool:
        hangs, more = [5.0] + [0.0] * (CHUNK - 1), [0.25] * (CHUNK + 1)
        found = [result for _, result in pool.map(doze, [[0.1] * CHUNK, hangs, more])]
    assert found[0] == CHUNK
    assert "executor.timeout_s" in str(found[1])
    assert found[2] == CHUNK + 1


def doze(chunk):
    for seconds in chunk:
        time.sleep(seconds)
    return len(chunk)


# --- faults of the machine ------------------------------------------------------------------------------------------


def test_what_only_a_process_lacks_another_one_has():
    with executor(workers=1) as pool:
        assert [
            result for _, result in pool.map(misfortune, [["a"], ["spoilt"], ["b"]])
        ] == [["a"], ["spoilt"], ["b"]]


def test_what_the_machine_lacks_is_told_from_what_a_chunk_does():
    with executor(workers=1) as pool:
        (_, before), (_, fault), (_, after) = pool.map(
            misfortune, [["a"], ["no room"], ["b"]]
        )
    assert (before, after) == (["a"], ["b"])
    assert isinstance(fault, Fault)
    assert str(fault) == "OSError: [Errno 28] No space left on device: '/somewhere'"


class Unready:
    def prepare(self):
        raise ImportError("libEngine.so: cannot open shared object file")

    def __call__(self, chunk):
        return len(chunk)


def test_what_keeps_a_worker_from_starting_is_said(capfd):
    with (
        executor(workers=1) as pool,
        pytest.raises(UserError, match=r"can't be used: ImportError: libEngine\.so"),
    ):
        list(pool.map(Unready(), [[1]]))
    assert capfd.readouterr().err == ""


def make_file(chunk):
    """Leave a file in the temporary folder; die at the second."""
    handle, name = tempfile.mkstemp()
    os.close(handle)
    if chunk[0] == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    return name


@pytest.mark.thorough
def test_a_worker_keeps_its_temporary_files_with_those_of_the_run():
    with executor(workers=1) as pool:
        results = [result for _, result in pool.map(make_file, [["a"], ["die"], ["b"]])]
    assert Path(results[0]).is_relative_to(scratch())
    assert Path(results[2]).is_relative_to(scratch())


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("memory_mb", 0),
        ("workers", 0),
        ("workers", -2),
        ("timeout_s", 0),
        ("timeout_s", -1),
    ],
)
def test_numbers_that_make_no_sense(setting, value):
    with pytest.raises(UserError, match=setting):
        executor(**{setting: value})

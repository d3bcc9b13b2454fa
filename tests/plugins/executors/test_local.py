import os
import signal
import time

import pytest

from core.errors import UserError
from core.plugins import installed


def executor(**settings):
    return installed().create("executor", "local", settings)


# What workers do: functions of a module, so that they can travel.


def double(chunk):
    return [2 * x for x in chunk]


def who(chunk):
    time.sleep(0.05)
    return os.getpid()


def misfortune(chunk):
    match chunk[0]:
        case "raise":
            raise ValueError("this chunk is bad")
        case "exit":
            os._exit(3)
        case "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        case "hang":
            time.sleep(60)
    return chunk


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize("workers", [1, 2])
def test_each_chunk_comes_with_its_result(workers):
    chunks = [[i, i + 1] for i in range(7)]
    with executor(workers=workers) as pool:
        found = list(pool.map(double, chunks))
        again = list(pool.map(double, chunks[:2]))
    assert sorted(found) == [(chunk, [2 * x for x in chunk]) for chunk in chunks]
    assert len(again) == 2
    assert all(any(chunk is own for own in chunks) for chunk, _ in found)  # the very chunk, not a copy that travelled


def test_no_chunks_start_no_process():
    with executor(workers=1) as pool:
        began = time.monotonic()
        assert list(pool.map(double, [])) == []
        assert time.monotonic() - began < 0.1


def test_what_befalls_a_chunk_befalls_no_other():
    chunks = [["a"], ["raise"], ["b"], ["exit"], ["c"], ["kill"], ["d"], ["hang"], ["e"]]
    with executor(workers=2, timeout_s=3.0) as pool:
        found = {chunk[0]: result for chunk, result in pool.map(misfortune, chunks)}
        assert list(pool.map(double, [[1]])) == [([1], [2])]  # and the pool goes on
    assert {name: found[name] for name in "abcde"} == {name: [name] for name in "abcde"}
    assert isinstance(found["raise"], ValueError)
    assert str(found["raise"]) == "this chunk is bad"
    assert "died" in str(found["exit"])
    assert "3" in str(found["exit"])
    assert "died" in str(found["kill"])
    assert "executor.timeout_s" in str(found["hang"])
    assert all(isinstance(found[name], Exception) for name in ("exit", "kill", "hang"))


def test_chunks_are_read_no_faster_than_they_are_needed():
    read = []

    def chunks():
        for i in range(30):
            read.append(i)
            yield [i]

    with executor(workers=2) as pool:
        for done, _ in enumerate(pool.map(who, chunks()), start=1):
            assert len(read) - done <= 2 * 2 + 1  # one in work and one waiting for each worker, one in hand


def test_closing_ends_the_workers():
    with executor(workers=2) as pool:
        processes = {pid for _, pid in pool.map(who, [[i] for i in range(8)])}
        assert os.getpid() not in processes
        assert all(alive(pid) for pid in processes)
        assert len(processes) <= 2
    assert not any(alive(pid) for pid in processes)


def test_closing_waits_for_nobody():
    with executor(workers=1) as pool:
        results = pool.map(misfortune, [["a"], ["hang"]])
        assert next(results) == (["a"], ["a"])
        began = time.monotonic()
    assert time.monotonic() - began < 5


def test_by_default_there_is_a_worker_for_each_core():
    assert executor().workers >= 1
    assert executor(workers=3).workers == 3


@pytest.mark.parametrize(("setting", "value"), [("workers", 0), ("workers", -2), ("timeout_s", 0), ("timeout_s", -1)])
def test_numbers_that_make_no_sense(setting, value):
    with pytest.raises(UserError, match=setting):
        executor(**{setting: value})

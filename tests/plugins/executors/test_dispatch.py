import threading
import time
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.interfaces import CHUNK
from plugins.executors.dispatch import dispatch, time_limit


@pytest.mark.parametrize(
    ("chunk", "limit"),
    [("a", 10), ("a" * CHUNK, 10), ("a" * (CHUNK + 1), 20), ([], 10), (None, 10)],
)
def test_a_chunk_has_no_more_time_than_one(chunk, limit):
    assert time_limit(10.0, chunk) == limit
    assert time_limit(None, chunk) is None


def test_chunks_are_read_no_faster_than_they_are_worked_on():
    read = []

    def chunks():
        for number in range(20):
            read.append(number)
            yield number

    results = dispatch([lambda n: n * n], chunks())
    assert next(results) == (0, 0)
    assert len(read) <= 4
    assert sorted(results) == [(n, n * n) for n in range(1, 20)]


def test_no_chunk_is_begun_after_the_end():
    """Workers that wait for the next chunk begin none when it comes too late."""
    may_go_on = threading.Event()
    begun = []

    def chunks():
        yield 0
        yield 1
        may_go_on.wait()
        yield from range(2, 9)

    results = dispatch([begun.append] * 3, chunks())
    next(results)
    next(results)
    results.close()
    may_go_on.set()
    time.sleep(0.2)
    assert sorted(begun) == [0, 1]


@pytest.mark.parametrize(
    "end", [SystemExit("enough"), OSError("no space"), MemoryError()]
)
@pytest.mark.parametrize("where", ["chunks", "worker"])
def test_a_thread_that_ends_is_not_waited_for(end, where):
    """A plugin may call sys.exit, in a worker's thread or in that which reads the chunks."""

    def chunks():
        yield 1
        if where == "chunks":
            raise end
        yield 2

    def work(chunk):
        if where == "worker" and chunk == 2:
            raise end
        return chunk

    with pytest.raises((type(end), RuntimeError)) as caught:
        list(dispatch([work, work], chunks()))
    assert type(end).__name__ in f"{caught.value!r}"


class Numbers(tuple):
    """A chunk of numbers."""

    def pieces(self, size):
        for begin in range(0, len(self), size):
            yield Numbers(self[begin : begin + size])


@settings(deadline=None, max_examples=50)
@given(
    lengths=st.lists(st.integers(1, 12), max_size=12),
    workers=st.integers(1, 5),
)
def test_each_member_of_a_chunk_is_worked_on_once(lengths, workers):
    chunks = [
        Numbers((number, k) for k in range(n)) for number, n in enumerate(lengths)
    ]
    results = [*dispatch([lambda chunk: chunk] * workers, chunks)]
    assert all(chunk == result for chunk, result in results)
    assert Counter(n for chunk, _ in results for n in chunk) == Counter(sum(chunks, ()))


def test_workers_share_the_last_chunk():
    """All begin a piece of it before any of them ends one."""
    count = 4
    all_read = threading.Event()
    all_begun = threading.Barrier(count)

    def chunks():
        yield from [Numbers([0])] * count
        yield Numbers(range(1, count + 1))
        all_read.set()

    def work(chunk):
        if chunk == (0,):
            all_read.wait(timeout=10)
            time.sleep(0.1)
        else:
            all_begun.wait(timeout=10)

        return len(chunk)

    results = [result for _, result in dispatch([work] * count, chunks())]
    assert results == [1] * (2 * count)


def test_chunks_that_others_follow_stay_whole():
    may_end = threading.Event()

    def chunks():
        yield Numbers(range(8))
        may_end.wait()

    results = dispatch([len, len], chunks())
    assert next(results) == (Numbers(range(8)), 8)
    may_end.set()
    assert [*results] == []

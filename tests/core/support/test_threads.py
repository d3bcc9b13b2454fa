import queue
import threading

import pytest

from core.support.threads import merge, run_in_thread


@pytest.mark.parametrize(
    "error",
    [ValueError("no"), SystemExit("enough"), KeyboardInterrupt(), GeneratorExit()],
)
def test_however_a_function_ends_its_end_arrives(error):
    def fail():
        raise error

    ends = queue.SimpleQueue()
    run_in_thread(fail, ends.put, "test")
    end = ends.get(timeout=30)
    assert isinstance(end, Exception)
    assert end is error or end.__cause__ is error
    assert type(error).__name__ in f"{type(end).__name__} {end}"


def test_a_function_that_returns_ends_without_an_error():
    ends = queue.SimpleQueue()
    run_in_thread(lambda: 1, ends.put, "test")
    assert ends.get(timeout=30) is None


def test_items_of_several_sources_come_as_they_are_given():
    gate = threading.Event()

    def late():
        gate.wait(30)
        yield "late"

    def early():
        yield "early"
        gate.set()

    assert [*merge({"late": late, "early": early})] == ["early", "late"]
    assert [*merge({})] == []


def test_what_a_source_raises_is_raised_after_what_it_gave():
    def fail():
        yield 1
        raise ValueError("no more")

    items = merge({"source": fail})
    assert next(items) == 1
    with pytest.raises(ValueError, match="no more"):
        next(items)


def test_a_source_that_nobody_waits_for_is_read_to_its_end():
    read = queue.SimpleQueue()

    def source():
        for number in range(3):
            read.put(number)
            yield number

    items = merge({"source": source})
    next(items)
    items.close()
    assert [read.get(timeout=30) for _ in range(3)] == [0, 1, 2]

import queue

import pytest

from core.support.threads import run_in_thread


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

"""An agent's calls are answered one after the other by the run's thread, and too many of them are refused."""

import threading
from concurrent.futures import CancelledError

import pytest

from core.interfaces import Text
from plugins.agents.bench import MOST_WAITING, Bench, Later, Refused


class Clerk:
    """Answers with the call's name, and notes it."""

    def __init__(self):
        self.done = []

    def do(self, name, arguments):
        self.done.append(name)
        if name == "try":
            raise Later(arguments["designs"])
        if name == "finish":
            raise Later(None)
        if name == "refused":
            raise Refused("not so")
        if name == "broken":
            raise ZeroDivisionError("a\nb")
        return [Text(name)]


@pytest.fixture
def bench():
    return Bench(desk=Clerk())


def test_calls_are_answered_until_one_brings_designs(bench):
    first = bench.submit("look", {})
    wrong = [bench.submit("refused", {}), bench.submit("broken", {})]
    tried = bench.submit("try", {"designs": "{}"})
    later = bench.submit("look", {})
    assert bench.wait() is True
    assert bench.designs == "{}"
    assert first.result() == [Text("look")]
    assert [str(future.exception()) for future in wrong] == [
        "not so",
        "broken: ZeroDivisionError: a b",
    ]
    assert not tried.done()
    assert not later.done()

    bench.answer(lambda: [Text("earned 1")])
    assert tried.result() == [Text("earned 1")]
    bench.submit("finish", {})
    assert bench.wait() is False
    assert later.result() == [Text("look")]


def test_what_nobody_waits_for_any_more_is_not_done(bench):
    gone = bench.submit("try", {"designs": "{}"})
    bench.submit("finish", {})
    assert gone.cancel()
    assert bench.wait() is False
    assert bench.desk.done == ["finish"]
    with pytest.raises(CancelledError):
        gone.result()


def test_an_answer_that_nobody_waits_for_is_left_out(bench):
    bench.answer(lambda: [Text("of a resumed run")])
    bench.submit("finish", {})
    assert bench.wait() is False


def test_a_flood_is_refused_and_the_line_stays_short(bench):
    futures = []
    refused = 0
    for _ in range(10_000):
        try:
            futures.append(bench.submit("look", {}))
        except Refused:
            refused += 1
    assert (len(futures), refused) == (MOST_WAITING, 10_000 - MOST_WAITING)
    bench.leave()
    with pytest.raises(KeyboardInterrupt):
        bench.wait()
    assert all(future.done() for future in futures)


def test_an_agent_that_leaves_ends_the_wait_in_the_runs_thread(bench):
    ended = threading.Event()

    def run():
        with pytest.raises(KeyboardInterrupt):
            bench.wait()
        ended.set()

    thread = threading.Thread(target=run)
    thread.start()
    bench.leave()
    assert ended.wait(10)
    thread.join()


def test_a_run_that_fails_tells_who_waits_and_who_comes_later(bench):
    tried = bench.submit("try", {"designs": "{}"})
    assert bench.wait()
    waits = bench.submit("look", {})
    bench.end("the disk is full")
    for future in (tried, waits):
        assert str(future.exception()) == "the disk is full"
    with pytest.raises(Refused, match="the disk is full"):
        bench.submit("look", {})


def test_a_run_that_had_ended_before_says_so():
    bench = Bench()
    asked = bench.submit("look", {})
    bench.leave()
    with pytest.raises(KeyboardInterrupt):
        bench.serve()
    assert "has come to its end" in str(asked.exception())

"""Checks that every executor must pass. Each takes a factory, ``make()``, since an executor is used once."""

from __future__ import annotations

import contextlib
import math
import os
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product
from operator import length_hint

import numpy as np

from core.design import Candidate
from core.interfaces import Executor, Waypoints
from core.plugins import PluginPart
from core.search.trials import Trials, key_of
from core.simulation.play import play
from plugins.conformance.fitness import condition
from plugins.conformance.sample_tools import stick
from plugins.conformance.shared import simulators, some_task

Make = Callable[[], Executor]

MANY = 10_000  # chunks, which many workers would not end in `LONGEST_S`
CHUNK_S = 1.0  # an executor without workers ends after the chunk that it is at
AFTER = 8  # chunks after one whose worker dies
NOTICE_S = 0.1  # a chunk's work: in so much the death of a worker is noticed
LONGEST_S = 60.0  # for `map` to end once the executor is closed
LONGEST_START_S = 600.0  # for the first worker to give a result
# Of each process: what waits in this one is let go at the end.
_over = threading.Event()


def roots(chunk: list[float]) -> list[float]:
    """Square roots; negative numbers raise a ValueError."""
    return [math.sqrt(number) for number in chunk]


def check_each_chunk_comes_back_with_its_result(make: Make) -> None:
    chunks = [[float(n), float(n + 1)] for n in range(12)]
    due = [(chunk, roots(chunk)) for chunk in chunks]
    with make() as executor:
        pairs = sorted(executor.map(roots, chunks))

    assert len(pairs) == 12, f"12 chunks went in, {len(pairs)} came out"
    assert pairs == due, f"chunks came back with other results: {pairs}"


def check_an_exception_belongs_to_its_chunk(make: Make) -> None:
    with make() as executor:
        pairs = sorted(executor.map(roots, [[1.0], [-1.0], [4.0]]))

    (_, failed), *others = pairs
    assert others == [([1.0], [1.0]), ([4.0], [2.0])], (
        "a chunk that raised affects other chunks"
    )
    assert isinstance(failed, ValueError), (
        f"a chunk that raised ValueError has the result {failed!r}"
    )


def check_chunks_are_not_read_all_at_once(make: Make) -> None:
    """They arrive as a model answers, and may be many."""
    numbers = iter(range(1000))
    with make() as executor:
        results = executor.map(roots, ([float(number)] for number in numbers))
        next(results)
        read = 1000 - length_hint(numbers)

    assert read < 500, (
        f"before the first result was taken, {read} of 1000 chunks were read"
    )


def check_an_exception_of_the_source_is_raised(make: Make) -> None:
    def chunks() -> Iterator[list[float]]:
        yield [1.0]
        raise LookupError("no more chunks")

    with make() as executor, contextlib.suppress(LookupError):
        list(executor.map(roots, chunks()))
        raise AssertionError("an exception of the chunks' source is swallowed")


def die(chunk: list[int]) -> list[int]:
    """End the process at once if the chunk says so, unless it is the one that is named first; else take a moment."""
    home, ends = chunk
    if ends and os.getpid() != home:
        os._exit(3)

    time.sleep(NOTICE_S)
    return [os.getpid()]


def check_a_dead_worker_costs_its_chunk_alone(make: Make) -> str | None:
    """Nor does it cost those that come after it is noticed, as with a pool that is broken then."""
    home = os.getpid()
    with make() as executor:
        results = [*executor.map(die, [[home, 0], [home, 1], *[[home, 0]] * AFTER])]

    died = [result for (_, ends), result in results if ends]
    others = [result for (_, ends), result in results if not ends]
    assert [type(result) for result in others] == [list] * (1 + AFTER), (
        f"a worker that died took other chunks with it: {others}"
    )
    if died == [[home]]:
        return "it calls the function in this process, where no worker can die"

    what = f"the chunk of a worker that died has the result {died}, not an exception"
    assert len(died) == 1, what
    assert isinstance(died[0], Exception), what
    return None


def wait_for(chunk: list[float]) -> list[float]:
    """Wait so many seconds."""
    _over.wait(chunk[0])
    return chunk


def check_map_ends_when_another_thread_closes(make: Make) -> None:
    executor = make()
    begun = threading.Event()
    _over.clear()

    def read() -> None:
        with contextlib.suppress(Exception):  # which `map` may end with
            for _ in executor.map(wait_for, [[CHUNK_S]] * MANY):
                begun.set()

    reading = threading.Thread(target=read, name="reads results", daemon=True)
    reading.start()
    try:
        assert begun.wait(LONGEST_START_S), "no chunk came back"
        executor.close()
        reading.join(LONGEST_S)
        assert not reading.is_alive(), "close was called, and map waits on"
    finally:
        _over.set()


def check_rollouts_side_by_side_are_those_played_one_by_one(make: Make) -> str:
    """In each engine that plays one job at a time, four chunks at once give the same trials, to the bit."""
    names = [name for name, simulator in simulators() if simulator.batch == 1]
    candidates = _make_candidates()
    with make() as executor:
        for name in names:
            here = replace(condition(), sim=PluginPart[object]("sim", name))
            conditions = [here, replace(here, layout=1)]
            trials = Trials(executor)
            list(trials.try_in(conditions, candidates))

            for where, candidate in product(conditions, candidates):
                (alone,) = play(where, [candidate])
                found = trials.known[key_of(candidate, where)]
                what = f"in {name} a rollout beside others is not what it is alone"
                # As text, since nan is like nan.
                assert str(found) == str(alone), f"{what}: {found} instead of {alone}"
                assert alone.status == "ok", f"in {name}: {alone.reason}"

    return f"in {', '.join(names)}"


def _make_candidates() -> list[Candidate]:
    """Make candidates of two tools, with two plans each."""
    home = some_task().home
    candidates = []
    for agent, action in product(range(2), range(2)):
        down = home.position - (0.0, 0.1 * action, 0.15)
        ahead = np.add(down, (0.15, 0.0, 0.0))
        plan = Waypoints(np.array([[*down, *home.rpy], [*ahead, *home.rpy]]))
        tool = stick(0.25 + 0.05 * agent)
        candidates.append(Candidate(tool, plan, 0, agent, 0, action))

    return candidates

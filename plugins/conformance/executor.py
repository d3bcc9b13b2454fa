"""Checks that every executor must pass. Each takes a factory, ``make()``, since an executor is used once."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator

from core.interfaces import Executor
from plugins.conformance.checking import expect

Make = Callable[[], Executor]


def roots(chunk: list[float]) -> list[float]:
    """Square roots; negative numbers raise a ValueError."""
    return [math.sqrt(number) for number in chunk]


def check_each_chunk_comes_back_with_its_result(make: Make) -> None:
    chunks = [[float(n), float(n + 1)] for n in range(12)]
    due = [(chunk, roots(chunk)) for chunk in chunks]
    with make() as executor:
        pairs = sorted(executor.map(roots, chunks))
        expect(
            len(pairs) == len(due), f"{len(due)} chunks went in, {len(pairs)} came out"
        )
        expect(pairs == due, f"chunks came back with other results: {pairs}")


def check_an_exception_belongs_to_its_chunk(make: Make) -> None:
    with make() as executor:
        results = {
            chunk[0]: result
            for chunk, result in executor.map(roots, [[1.0], [-1.0], [4.0]])
        }

    expect(
        results.get(1.0) == [1.0] and results.get(4.0) == [2.0],
        "a chunk that raised affects other chunks",
    )
    result = results.get(-1.0)
    expect(
        isinstance(result, ValueError),
        f"a chunk that raised ValueError has the result {result!r}",
    )


def check_chunks_are_not_read_all_at_once(make: Make) -> None:
    """They arrive as a model answers, and may be many."""
    read = 0

    def chunks() -> Iterator[list[float]]:
        nonlocal read
        for number in range(1000):
            read = number + 1
            yield [float(number)]

    with make() as executor:
        results = executor.map(roots, chunks())
        next(results)
        expect(
            read < 500,
            f"before the first result was taken, {read} of 1000 chunks were read",
        )


def check_an_exception_of_the_source_is_raised(make: Make) -> None:
    def chunks() -> Iterator[list[float]]:
        yield [1.0]
        raise LookupError("no more chunks")

    with make() as executor, contextlib.suppress(LookupError):
        list(executor.map(roots, chunks()))
        raise AssertionError("an exception of the chunks' source is swallowed")

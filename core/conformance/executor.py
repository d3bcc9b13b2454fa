"""What any executor must satisfy: each check takes a factory, ``make()``, since one ends with its use, and raises an
AssertionError that says what is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from core.conformance.checking import expect
from core.interfaces import Executor

Make = Callable[[], Executor]


def roots(chunk: list[float]) -> list[float]:
    """Of numbers; of negative ones there is none."""
    return [math.sqrt(number) for number in chunk]


def check_each_chunk_comes_back_with_its_result(make: Make) -> None:
    chunks = [[float(n), float(n + 1)] for n in range(12)]
    with make() as executor:
        came = list(executor.map(roots, chunks))
        expect(sorted(chunk for chunk, _ in came) == chunks, f"{len(chunks)} chunks went in, {len(came)} came out")
        for chunk, result in came:
            expect(result == roots(chunk), f"of {chunk} came {result!r} instead of {roots(chunk)}")
        again = list(executor.map(roots, [[4.0]]))
        expect(again == [([4.0], [2.0])], f"the second use gave {again!r}")
        expect(list(executor.map(roots, [])) == [], "of no chunks something came")


def check_what_raises_is_told_with_its_chunk(make: Make) -> None:
    with make() as executor:
        came = {chunk[0]: result for chunk, result in executor.map(roots, [[1.0], [-1.0], [4.0]])}
    expect(came.get(1.0) == [1.0] and came.get(4.0) == [2.0], "a chunk that raised took others along")
    told = came.get(-1.0)
    expect(isinstance(told, ValueError), f"of a chunk that raised ValueError came {told!r}")


def check_chunks_are_not_read_all_at_once(make: Make) -> None:
    """They come as a model answers, and may be many."""
    read = 0

    def chunks() -> Iterator[list[float]]:
        nonlocal read
        for number in range(1000):
            read = number + 1
            yield [float(number)]

    with make() as executor:
        results = executor.map(roots, chunks())
        next(results)
        expect(read < 500, f"before the first result was taken, {read} of 1000 chunks were read")


def check_what_chunks_raise_is_raised(make: Make) -> None:
    def chunks() -> Iterator[list[float]]:
        yield [1.0]
        raise LookupError("the source is dry")

    told = False
    with make() as executor:
        try:
            list(executor.map(roots, chunks()))
        except LookupError:
            told = True
    expect(told, "an exception of the chunks' source was swallowed")


CHECKS = (
    check_each_chunk_comes_back_with_its_result,
    check_what_raises_is_told_with_its_chunk,
    check_chunks_are_not_read_all_at_once,
    check_what_chunks_raise_is_raised,
)

"""Run functions in threads whose results, and whose end, arrive where they are awaited, however they end."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

T = TypeVar("T")


def run_in_thread(
    function: Callable[[], object],
    ended: Callable[[Exception | None], object],
    name: str,
) -> None:
    """Run ``function`` in a daemon thread, and then call ``ended`` there with what it raised; None: nothing.

    A thread that ended without a word, as by a plugin's ``sys.exit``, would be waited for without end.
    """

    def run() -> None:
        raised: Exception | None = None
        try:
            function()
        except Exception as error:
            raised = error
        except BaseException as error:
            raised = RuntimeError(
                f"{type(error).__name__} ended the thread {name!r}: {error}"
            )
            # Which shows whose code it was.
            raised = raised.with_traceback(error.__traceback__)
            raised.__cause__ = error

        ended(raised)

    threading.Thread(target=run, name=name, daemon=True).start()


@dataclass(frozen=True)
class _End:
    """A source has no more items; or it raised an error."""

    error: Exception | None


def merge(sources: Mapping[str, Callable[[], Iterable[T]]]) -> Iterator[T]:
    """Yield the items of several sources as they come, each read in a thread of its own.

    What a source raises is raised here. A source that nobody waits for any more is read to its end all the same.

    Args:
        sources: what begins to give items when it is called, by the names of their threads.
    """
    arrived: queue.SimpleQueue[T | _End] = queue.SimpleQueue()

    def read(source: Callable[[], Iterable[T]]) -> None:
        for item in source():
            arrived.put(item)

    def end(error: Exception | None) -> None:
        arrived.put(_End(error))

    for name, source in sources.items():
        run_in_thread(partial(read, source), end, name)

    running = len(sources)
    while running:
        item = arrived.get()
        if not isinstance(item, _End):
            yield item
            continue

        running -= 1
        if item.error is not None:
            raise item.error

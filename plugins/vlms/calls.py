"""Make calls of a model side by side: each in a thread, the replies as they come; and say how much arrives."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from core.errors import LimitReached
from core.interfaces import Reply, Request
from core.support.progress_display import note
from core.support.threads import merge

LONGEST_LEAD_S = 60.0  # so long the others wait for the first sign of an answer


class Arrivals:
    """How many characters of answers under way have arrived; the progress display says so.

    Args:
        name: of the model, which tells apart what several models say.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._characters: dict[str, int] = {}
        self._lock = threading.Lock()

    def hear(self, request_id: str, characters: int) -> None:
        """Note how many characters of an answer have arrived."""
        with self._lock:
            self._characters[request_id] = characters
            self._say()

    def end(self, request_id: str) -> None:
        """Note that an answer is complete, or that none comes."""
        with self._lock:
            self._characters.pop(request_id, None)
            self._say()

    def _say(self) -> None:
        total = sum(self._characters.values())
        answers = len(self._characters)
        what = "an answer" if answers == 1 else f"{answers} answers"
        note(self._name, f"{total:,} characters of {what} arrived" if total else "")


@dataclass(eq=False)
class Calls:
    """Makes calls side by side.

    Attributes:
        name: of the model, which names threads.
        concurrency: calls that may wait for an answer at the same time.
        answer: makes the call of a request. An event is set when nobody waits for the reply any more.
        fail: makes the reply of a call that raised.
    """

    name: str
    concurrency: int
    answer: Callable[[Request, threading.Event], Reply]
    fail: Callable[[Request, Exception], Reply]

    def __post_init__(self) -> None:
        self._led = threading.Event()

    def lead(self) -> None:
        """Let the other calls begin: the first one's answer arrives."""
        self._led.set()

    def replies(self, requests: Sequence[Request], *, first: bool) -> Iterator[Reply]:
        """Yield replies as they come; see `core.interfaces.VLM.complete`.

        When the caller closes the iterator, calls that have not begun are dropped. When a limit is reached, calls that
        are under way are completed.

        Args:
            requests: that are answered.
            first: the others wait until `lead` is called, or until the first is answered.

        Raises:
            LimitReached: after the last reply, if requests are left.
        """
        waiting: queue.SimpleQueue[Request] = queue.SimpleQueue()
        for request in requests:
            waiting.put(request)

        self._led.clear()
        if not first:
            self._led.set()

        stop = threading.Event()
        limits: list[LimitReached] = []
        workers = {
            f"{self.name} {number}": partial(
                self._work, waiting, limits, stop, follows=number > 0
            )
            for number in range(min(self.concurrency, len(requests)))
        }
        try:
            yield from merge(workers)
        finally:
            stop.set()

        if limits:
            raise LimitReached(
                f"{limits[0]}; {len(limits)} of {len(requests)} requests are left without a reply"
            )

    def _work(
        self,
        waiting: queue.SimpleQueue[Request],
        limits: list[LimitReached],
        stop: threading.Event,
        *,
        follows: bool,
    ) -> Iterator[Reply]:
        """Answer requests until there are no more.

        Args:
            waiting: the requests.
            limits: are added to where a request is left without a reply.
            stop: is set when nobody waits any more.
            follows: it begins when the first answer arrives, or after a while.
        """
        until = time.monotonic() + LONGEST_LEAD_S
        while follows and not stop.is_set() and time.monotonic() < until:
            follows = not self._led.wait(0.1)

        while not stop.is_set():
            try:
                request = waiting.get_nowait()
            except queue.Empty:
                return
            try:
                yield self._reply(request, stop)
            except LimitReached as limit:
                limits.append(limit)

    def _reply(self, request: Request, stop: threading.Event) -> Reply:
        """Answer a request.

        Raises:
            LimitReached: it is left without a reply.
        """
        try:
            return self.answer(request, stop)
        except LimitReached:
            raise
        except Exception as error:
            return self.fail(request, error)
        finally:
            self._led.set()

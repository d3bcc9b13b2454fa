"""Run a function in a thread whose end arrives where it is awaited, however it ends."""

from __future__ import annotations

import threading
from collections.abc import Callable


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

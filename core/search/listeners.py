"""Pass events on to listeners, so that one that raises costs itself and not the run."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from functools import wraps
from typing import Any

import pluggy

from core.errors import RAISED
from core.hooks import hookimpl
from core.plugins import describe_part
from core.support.cli import say


def add_listener(hub: pluggy.PluginManager, listener: object, name: str) -> Guard:
    """Register ``listener`` with ``hub`` until it raises an exception.

    The first one is reported on standard error in one line, which names the listener, the event and the error. From
    then on the listener receives only ``run_ended``, so that it can let go of what it holds.
    """
    guard = Guard(hub, listener)
    hub.register(guard, name)
    return guard


class Guard:
    """Stands for a listener at the hub: it implements the same events, and lets no exception through.

    ``exited`` says which event it answered by ending the process, if it tried to.
    """

    def __init__(self, hub: pluggy.PluginManager, listener: object) -> None:
        self.exited: str | None = None
        self._listener = listener
        self._failed = False
        self._lock = threading.Lock()  # replies are received in a thread of their own
        for attribute in dir(listener):
            options = hub.parse_hookimpl_opts(listener, attribute)
            if options is not None:
                event = options.get("specname") or attribute
                function = getattr(listener, attribute)
                if not options["wrapper"] and not options["hookwrapper"]:  # which are generators
                    function = hookimpl(**options)(self._guarded(event, function))
                setattr(self, attribute, function)

    def _guarded(self, event: str, function: Callable[..., None]) -> Callable[..., None]:
        @wraps(function)
        def pass_on(*arguments: Any) -> None:
            if self._failed and event != "run_ended":
                return
            try:
                function(*arguments)
            except RAISED as error:  # of a plugin
                self._report(event, error)

        return pass_on

    def _report(self, event: str, error: BaseException) -> None:
        with self._lock:
            first, self._failed = not self._failed, True
        if first:
            what = " ".join(f"{type(error).__name__}: {error}".split())
            blamed = f"{describe_part(self._listener)}: {event} raised {what}"
            self.exited = blamed if isinstance(error, SystemExit) else None
            say(f"{blamed}; it receives no more events", file=sys.stderr)

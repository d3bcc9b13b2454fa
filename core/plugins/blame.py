"""Attribute an exception to the plugin that raised it, and keep one of a listener from the run."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any

import pluggy

from core.errors import RAISED, UserError
from core.hooks import Command, hookimpl
from core.plugins.registry import Offer, Plugins, describe_part, installed, offer_of
from core.support.cli import say


class PluginError(Exception):
    """A plugin raised an exception that it may not raise; the message names both."""


def describe_failure(
    error: BaseException, plugins: Plugins | None = None
) -> str | None:
    """Name what a plugin raised, and the part that is deepest in the traceback, in one line.

    A part's code is its methods, and the module of its factory. None: no plugin is in the traceback, or the error
    names it already.
    """
    if isinstance(error, PluginError):
        return None
    offers = [*(plugins or installed()).offers.values()]
    modules = {
        _module(offer): offer for offer in reversed(offers)
    }  # the first one, of several in a module
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    for frame in reversed(frames):
        offer = offer_of(frame.f_locals.get("self")) or modules.get(
            frame.f_globals.get("__name__", "")
        )
        if offer is not None:
            return f"{offer.kind} {offer.name!r} of {offer.distribution} raised {type(error).__name__}: {error}"
    return None


def _module(offer: Offer) -> str:
    factory = (
        offer.factory.main if isinstance(offer.factory, Command) else offer.factory
    )
    return factory.partition(":")[0] if isinstance(factory, str) else factory.__module__


@contextmanager
def refuse_exit() -> Iterator[None]:
    """Turn `sys.exit` in a plugin's code into an error: it would end a command with status 0 and without a word.

    Raises:
        UserError: names the plugin.
    """
    try:
        yield
    except SystemExit as end:
        raise UserError(
            describe_failure(end) or f"the process was told to end: SystemExit: {end}"
        ) from end


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
        for attribute in dir(listener):
            options = hub.parse_hookimpl_opts(listener, attribute)
            if options is not None:
                guarded = self._guarded(attribute, getattr(listener, attribute))
                setattr(self, attribute, hookimpl(**options)(guarded))

    def _guarded(
        self, event: str, function: Callable[..., None]
    ) -> Callable[..., None]:
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
        if self._failed:
            return
        self._failed = True
        what = " ".join(f"{type(error).__name__}: {error}".split())
        blamed = f"{describe_part(self._listener)}: {event} raised {what}"
        if isinstance(error, SystemExit):
            self.exited = blamed
        say(f"{blamed}; it receives no more events", file=sys.stderr)

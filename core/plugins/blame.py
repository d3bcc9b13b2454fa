"""Attribute an exception to the plugin that raised it, and keep one of a listener from the run."""

from __future__ import annotations

import errno
import sys
import traceback
from collections.abc import Callable
from functools import wraps
from typing import Any

import pluggy

from core.design import DesignError
from core.errors import RAISED, in_line
from core.hooks import Command, hookimpl
from core.plugins.registry import Offer, Plugins, describe_part, installed
from core.support.cli import say
from core.support.text import shorten

# Errors of the machine, in the code of any plugin: they say nothing about a design.
_MACHINE = {
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EMFILE,
    errno.ENFILE,
    errno.ENOMEM,
    errno.EIO,
    errno.EROFS,
}


class PluginError(Exception):
    """A plugin raised an exception that it may not raise; the message names both."""


def describe_failure(error: BaseException) -> str | None:
    """Name what a plugin raised, and the part that is deepest in the traceback, in one line.

    A part's code is its methods, and the module of its factory. None: no plugin is in the traceback, or the error
    names it already.
    """
    if isinstance(error, PluginError):
        return None
    offers = installed().offers.values()
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    for frame in reversed(frames):
        origin = Plugins.origin(frame.f_locals.get("self"))
        module = frame.f_globals.get("__name__")
        offered = (offer for offer in offers if _module(offer) == module)
        blamed = origin or next(offered, None)
        if blamed is not None:
            return f"{blamed.owner} raised {in_line(error)}"

    return None


def _module(offer: Offer) -> str:
    factory = offer.factory
    code = factory.main if isinstance(factory, Command) else factory
    return code.partition(":")[0] if isinstance(code, str) else code.__module__


def judge_design(
    owner: str, judge: Callable[..., Any], *args: Any, **named: Any
) -> Any:
    """Call a plugin's code that reads or judges a design: a bug there costs the design, not the run.

    Raises:
        DesignError: the code raised it, or something else, errors of the machine apart; then the message names its
            ``owner``.
    """
    try:
        return judge(*args, **named)
    except (DesignError, MemoryError):
        raise
    except RAISED as error:
        if getattr(error, "errno", None) in _MACHINE:
            raise
        raise DesignError(f"{owner} raised {in_line(error)}") from error


def call_part(part: object, method: str, wanted: type, *args: Any, **named: Any) -> Any:
    """Call a method of a plugin's part that reads a design: a bug there costs the design, not the run.

    Raises:
        DesignError: see `judge_design`; or the method returned nothing of the type ``wanted``.
    """
    owner = f"{describe_part(part)}: {method}"
    value = judge_design(owner, getattr(part, method), *args, **named)

    if not isinstance(value, wanted):
        raise DesignError(
            f"{owner} gave {shorten(repr(value))}; expected {wanted.__name__}"
        )

    return value


def add_listener(hub: pluggy.PluginManager, listener: object, name: str) -> None:
    """Register ``listener`` with ``hub`` until it raises an exception (`ListenerProxy`)."""
    hub.register(ListenerProxy(hub, listener), name)


class ListenerProxy:
    """Stands for a listener at the hub: it implements the same events, and lets no exception through.

    The first exception is reported on standard error in one line, which names the listener, the event and the error.
    From then on the listener receives only ``run_ended``, so that it can let go of what it holds.
    """

    def __init__(self, hub: pluggy.PluginManager, listener: object) -> None:
        self._listener = listener
        self._failed = False
        for event in dir(listener):
            options = hub.parse_hookimpl_opts(listener, event)
            if options is not None:
                passed_on = self._pass_on(event, getattr(listener, event))
                setattr(self, event, hookimpl(**options)(passed_on))

    def _pass_on(self, event: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def pass_on(*arguments: Any) -> Any:
            if self._failed and event != "run_ended":
                return None
            try:
                return function(*arguments)
            except RAISED as error:  # of a plugin
                if not self._failed:
                    what = f"{describe_part(self._listener)}: {event} raised {in_line(error)}"
                    say(f"{what}; it receives no more events", file=sys.stderr)
                self._failed = True
                return None

        return pass_on

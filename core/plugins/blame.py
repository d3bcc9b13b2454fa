"""Attribute an exception to the plugin that raised it, or that called the code which did."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager

from core.errors import UserError
from core.hooks import Command
from core.plugins.discovery import Offer
from core.plugins.registry import Plugins, installed, offer_of


class PluginError(Exception):
    """A plugin raised an exception that it may not raise; the message names both."""


def culprit(error: BaseException, plugins: Plugins | None = None) -> Offer | None:
    """Return the plugin's part that is deepest in the exception's traceback; None: there is none in it.

    A part's code is the module of its factory, and the modules beside it if no other part is among them. Of several
    parts in one module it is the one whose method is deepest; the first, if no method is in the traceback.
    """
    own: dict[str, list[Offer]] = {}
    for offer in (plugins or installed()).offers.values():
        own.setdefault(_module(offer), []).append(offer)
    packages: dict[str, set[str]] = {}
    for module in own:
        packages.setdefault(module.rpartition(".")[0], set()).add(module)
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    for depth in reversed(range(len(frames))):
        name = str(frames[depth].f_globals.get("__name__", ""))
        package = name.rpartition(".")[0]
        if name not in own and package and len(packages.get(package, ())) == 1:
            name = next(iter(packages[package]))
        if name in own:
            made = (offer_of(frame.f_locals.get("self")) for frame in reversed(frames[: depth + 1]))
            return next((offer for offer in made if offer in own[name]), own[name][0])
    return None


def _module(offer: Offer) -> str:
    factory = offer.factory.main if isinstance(offer.factory, Command) else offer.factory
    return factory.partition(":")[0] if isinstance(factory, str) else str(getattr(factory, "__module__", ""))


def describe_failure(error: BaseException, plugins: Plugins | None = None) -> str | None:
    """Name the plugin and what it raised, in one line.

    None: no plugin is in the traceback, or the error names it already.
    """
    offer = None if isinstance(error, PluginError) else culprit(error, plugins)
    if offer is None:
        return None
    return f"{offer.kind} {offer.name!r} of {offer.distribution} raised {type(error).__name__}: {error}"


@contextmanager
def refuse_exit() -> Iterator[None]:
    """Turn `sys.exit` in a plugin's code into an error: it would end a command with status 0 and without a word.

    Raises:
        UserError: names the plugin.
    """
    try:
        yield
    except SystemExit as end:
        raise UserError(describe_failure(end) or f"the process was told to end: SystemExit: {end}") from end

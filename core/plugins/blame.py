"""Whose fault an exception is: the plugin in whose code it was raised, or in whose behalf."""

from __future__ import annotations

import traceback

from core.plugins.discovery import Offer
from core.plugins.registry import Plugins, installed


class PluginError(Exception):
    """A plugin raised what it may not; says which plugin, and what."""


def culprit(error: BaseException, plugins: Plugins | None = None) -> Offer | None:
    """The plugin that is deepest in the exception's traceback; None: there is none in it.

    A plugin's code is the module of its factory, and the modules beside it if no other plugin is among them.
    """
    offers = list((plugins or installed()).offers.values())
    own = {_module(offer): offer for offer in reversed(offers)}  # of two in one module, the first
    packages: dict[str, set[str]] = {}
    for module in own:
        packages.setdefault(module.rpartition(".")[0], set()).add(module)
    for frame, _ in reversed(list(traceback.walk_tb(error.__traceback__))):
        name = str(frame.f_globals.get("__name__", ""))
        if name in own:
            return own[name]
        package = name.rpartition(".")[0]
        if package and len(packages.get(package, ())) == 1:
            return own[next(iter(packages[package]))]
    return None


def _module(offer: Offer) -> str:
    if isinstance(offer.factory, str):
        return offer.factory.partition(":")[0]
    return str(getattr(offer.factory, "__module__", ""))


def describe_failure(error: Exception, plugins: Plugins | None = None) -> str | None:
    """One line that names the plugin and what it raised; None: no plugin was at work, or the error names it already."""
    offer = None if isinstance(error, PluginError) else culprit(error, plugins)
    if offer is None:
        return None
    return f"{offer.kind} {offer.name!r} of {offer.distribution} raised {type(error).__name__}: {error}"

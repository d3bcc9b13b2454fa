"""Finds plugins by their entry points and makes parts by name. ``python -m core.plugins`` prints what there is.

An entry point that fails to load is remembered with its reason and hurts nobody else.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import inspect
import typing
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import pluggy
import pydantic

from core.errors import UsageError, UserError, choices
from core.hooks import PROJECT, Events, Factory, Parts

KINDS = {
    "task": "tasks",
    "sim": "simulators",
    "vlm": "vlms",
    "tool": "tool_representations",
    "evolution": "evolution_strategies",
    "executor": "executors",
    "logger": "listeners",
}
"""The config group of each kind of part, and the hook that offers it."""


@dataclass(frozen=True)
class Offer:
    """One part that can be made: its kind (config group) and name, who offers it, and how it is made."""

    kind: str
    name: str
    entry_point: str
    distribution: str
    factory: Factory


@dataclass(frozen=True)
class Failure:
    """A plugin, or one hook of it, that could not be used, and why."""

    entry_point: str
    distribution: str
    reason: str


class Plugins:
    """What is installed: ``offers`` by (kind, name), and ``failures``."""

    def __init__(self, entry_points: Mapping[str, Any] | None = None) -> None:
        self.offers: dict[tuple[str, str], Offer] = {}
        self.failures: list[Failure] = []
        for entry in importlib.metadata.entry_points(group=PROJECT):
            distribution = entry.dist.name if entry.dist else "?"
            try:
                module = entry.load()
            except Exception as error:  # whatever a stranger's import raises
                self.failures.append(
                    Failure(entry.name, distribution, f"import failed: {type(error).__name__}: {error}")
                )
                continue
            self.register(module, entry.name, distribution)
        for name, module in (entry_points or {}).items():
            self.register(module, name, "this process")

    def register(self, plugin: Any, name: str, distribution: str) -> None:
        """Take in what ``plugin`` (a module or an object) offers, as if an entry point ``name`` had named it."""
        manager = pluggy.PluginManager(PROJECT)
        manager.add_hookspecs(Parts)
        try:
            manager.register(plugin, name)
        except pluggy.PluginValidationError as error:
            self.failures.append(Failure(name, distribution, " ".join(str(error).split())))
            return
        for kind, hook in KINDS.items():
            try:
                offered = [factories for factories in getattr(manager.hook, hook)() if factories is not None]
                for part, factory in (item for factories in offered for item in dict(factories).items()):
                    self._offer(Offer(kind, part, name, distribution, factory))
            except Exception as error:  # whatever a stranger's hook raises
                reason = f"hook {hook!r} failed: {type(error).__name__}: {error}"
                self.failures.append(Failure(name, distribution, reason))

    def _offer(self, offer: Offer) -> None:
        if not isinstance(offer.factory, str) and not callable(offer.factory):
            reason = (
                f"{offer.kind} {offer.name!r} is {offer.factory!r}; it must be callable, or a text 'module:attribute'"
            )
            self.failures.append(Failure(offer.entry_point, offer.distribution, reason))
            return
        taken = self.offers.get((offer.kind, offer.name))
        if taken is not None:
            reason = f"{offer.kind} {offer.name!r} is taken by {taken.entry_point} of {taken.distribution}"
            self.failures.append(Failure(offer.entry_point, offer.distribution, reason))
            return
        self.offers[offer.kind, offer.name] = offer

    def names(self, kind: str) -> list[str]:
        """What there is of a kind, sorted."""
        return sorted(name for of, name in self.offers if of == kind)

    def factory(self, kind: str, name: str) -> Callable[..., Any]:
        """What makes the part ``name`` of a kind.

        Raises:
            UserError: there is none of that name, or it can't be imported.
        """
        offer = self.offers.get((kind, name))
        if offer is None:
            failed = "".join(f"; plugin {f.entry_point!r} failed to load: {f.reason}" for f in self.failures)
            raise UserError(f"{choices(kind, name, self.names(kind))}{failed}")
        if not isinstance(offer.factory, str):
            return offer.factory
        module, _, attribute = offer.factory.partition(":")
        try:
            return typing.cast(Callable[..., Any], getattr(importlib.import_module(module), attribute))
        except Exception as error:  # whatever a stranger's import raises
            raise UserError(
                f"{kind} {name!r} of {offer.distribution} can't be imported: {type(error).__name__}: {error}"
            ) from error

    def create(self, kind: str, name: str, settings: Mapping[str, Any] | None = None, **given: Any) -> Any:
        """Make a part: its factory is called with ``settings``, checked against its signature, and with what the
        caller gives.

        Raises:
            UserError: no such part, a setting that it does not have or whose type is wrong, or a setting that it needs.
        """
        factory = self.factory(kind, name)
        checked = check_settings(factory, settings or {}, f"{kind}={name}", given)
        return factory(**checked, **given)


def check_settings(
    factory: Callable[..., Any], settings: Mapping[str, Any], where: str, given: Mapping[str, Any]
) -> dict[str, Any]:
    """``settings`` with the types that the factory's signature names.

    Raises:
        UserError: a setting that is unknown, missing, or of the wrong type.
    """
    parameters = {
        name: parameter
        for name, parameter in inspect.signature(factory).parameters.items()
        if name not in given and parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)
    }
    hints = typing.get_type_hints(factory.__init__ if inspect.isclass(factory) else factory)
    checked: dict[str, Any] = {}
    for name, value in settings.items():
        if name not in parameters:
            raise choices("setting", name, parameters, where)
        try:
            checked[name] = pydantic.TypeAdapter(hints.get(name, Any)).validate_python(value)
        except pydantic.ValidationError as error:
            reason = error.errors()[0]["msg"]
            raise UsageError(f"{where}: setting {name!r} can't be {value!r}: {reason}") from error
    for name, parameter in parameters.items():
        if parameter.default is parameter.empty and name not in checked:
            raise UsageError(f"{where}: setting {name!r} is needed; settings: {', '.join(parameters)}")
    return checked


@lru_cache(maxsize=1)
def installed() -> Plugins:
    """The plugins of this environment, found once per process."""
    return Plugins()


def event_hub() -> pluggy.PluginManager:
    """A manager that carries `Events` to the listeners registered with it."""
    hub = pluggy.PluginManager(PROJECT)
    hub.add_hookspecs(Events)
    return hub


def main() -> None:
    """Print a table of every part, and what failed to load."""
    import rich.console
    import rich.table

    plugins = installed()
    table = rich.table.Table("kind", "name", "entry point", "distribution", box=None, header_style="bold")
    for kind in KINDS:
        for name in plugins.names(kind):
            offer = plugins.offers[kind, name]
            table.add_row(kind, name, offer.entry_point, offer.distribution)
    console = rich.console.Console()
    console.print(table)
    for failure in plugins.failures:
        console.print(
            f"[red]failed[/] {failure.entry_point} ({failure.distribution}): {failure.reason}", highlight=False
        )


if __name__ == "__main__":
    main()

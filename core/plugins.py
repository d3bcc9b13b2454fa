"""Finds plugins by their entry points and makes parts by name. ``python -m core.plugins`` prints what there is.

An entry point that fails to load is remembered with its reason and hurts nobody else.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.metadata
import importlib.util
import inspect
import subprocess
import sys
import typing
import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import pluggy
import pydantic

from core.cli import command
from core.errors import UsageError, UserError, choices
from core.hooks import PROJECT, Configs, Events, Factory, Parts
from core.interfaces import VLM, EvolutionStrategy, Executor, Simulator, Task, ToolRepresentation

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

INTERFACES: dict[str, type] = {
    "task": Task,
    "sim": Simulator,
    "vlm": VLM,
    "tool": ToolRepresentation,
    "evolution": EvolutionStrategy,
    "executor": Executor,
}
"""What the parts of a kind are; listeners are whatever hears an event."""

ATTRIBUTES = {"task": ("name", "description", "goals"), "vlm": ("model",)}
"""What they have besides methods."""

GIVEN = {"evolution": ("designer", "budget")}
"""Which arguments of a kind's factories the program gives; the others are settings."""


@dataclass(frozen=True)
class Offer:
    """One part that can be made: its kind (config group) and name, who offers it, and how it is made."""

    kind: str
    name: str
    entry_point: str
    distribution: str
    factory: Factory

    def __str__(self) -> str:
        return f"{self.kind} {self.name!r} of {self.distribution} (hook {KINDS[self.kind]!r})"


@dataclass(frozen=True)
class Failure:
    """A plugin, or one hook of it, that could not be used, and why."""

    entry_point: str
    distribution: str
    reason: str


class Plugins:
    """What is installed: ``offers`` by (kind, name), the packages of Hydra ``configs`` by distribution, and
    ``failures``.
    """

    def __init__(self, entry_points: Mapping[str, Any] | None = None) -> None:
        self.offers: dict[tuple[str, str], Offer] = {}
        self.configs: dict[str, list[str]] = {}
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
        manager.add_hookspecs(Configs)
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

        try:
            for path in manager.hook.config_path():
                _check_config_path(path)
                self.configs.setdefault(distribution, []).append(path)
        except Exception as error:  # whatever a stranger's hook raises
            reason = f"hook 'config_path' failed: {type(error).__name__}: {error}"
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
            UserError: no such part, a setting that it does not have or whose type is wrong, a setting that it needs, or
            what the factory gives is no part of that kind; says whose it is.
        """
        factory, offer = self.factory(kind, name), self.offers[kind, name]
        checked = check_settings(factory, settings or {}, f"{kind}={name}", given)
        left = sorted(getattr(factory, "__abstractmethods__", ()))
        if left:
            raise UserError(f"{offer} can't be made: {factory.__qualname__} lacks {', '.join(left)}")
        try:
            part = factory(**checked, **given)
        except (UserError, KeyboardInterrupt):
            raise
        except Exception as error:  # whatever a stranger's code raises
            raise UserError(f"{offer} can't be made: {type(error).__name__}: {error}") from error
        _check_part(part, offer)
        with contextlib.suppress(TypeError):  # one that can't be a key is told by its class
            _made[part] = offer
        return part


_made: weakref.WeakKeyDictionary[Any, Offer] = weakref.WeakKeyDictionary()


def whose(part: object) -> str:
    """Of a part that was made here: its kind, its name, the distribution and the hook; of others the class."""
    with contextlib.suppress(TypeError):
        if part in _made:
            return str(_made[part])
    return f"{type(part).__module__}.{type(part).__qualname__}"


def _check_part(part: object, offer: Offer) -> None:
    """Refuse what the rest of the program could not use.

    Raises:
        UserError: says what it is and lacks.
    """
    interface = INTERFACES.get(offer.kind)
    if interface is None:
        _check_listener(part, offer)
        return
    if not isinstance(part, interface):
        what = f"a {type(part).__name__}, which is no core.interfaces.{interface.__name__}"
        raise UserError(f"{offer} makes {what}")
    missing = [name for name in ATTRIBUTES.get(offer.kind, ()) if not hasattr(part, name)]
    if missing:
        raise UserError(f"{offer}: {type(part).__qualname__} has no {' and no '.join(missing)}")


def _check_listener(part: object, offer: Offer) -> None:
    hub = event_hub()
    try:
        hub.register(part)
    except pluggy.PluginValidationError as error:
        raise UserError(f"{offer}: {' '.join(str(error).split())}") from error
    known = [name for name in vars(Events) if not name.startswith("_")]
    heard = {caller.name for caller in hub.get_hookcallers(part) or ()}
    if not heard & set(known):
        raise UserError(f"{offer} hears nothing: {type(part).__qualname__} implements none of {', '.join(known)}")
    hub.unregister(part)


def _check_config_path(path: object) -> None:
    """Refuse what is no package that is there.

    Raises:
        ValueError: says what is expected.
    """
    expected = 'expected a package that holds YAML files, "pkg://my_package.conf"'
    if not isinstance(path, str) or not path.startswith("pkg://"):
        raise ValueError(f"it gave {path!r}; {expected}")
    package = path.removeprefix("pkg://").replace("/", ".")
    if importlib.util.find_spec(package) is None:  # raises where a package above is missing
        raise ValueError(f"there is no package {package!r}; {expected}")


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


@dataclass(frozen=True)
class Part:
    """A part by name and settings: what a worker process needs to make its own."""

    kind: str
    name: str
    settings: tuple[tuple[str, Any], ...] = ()

    def create(self, **given: Any) -> Any:
        return installed().create(self.kind, self.name, dict(self.settings), **given)


def event_hub() -> pluggy.PluginManager:
    """A manager that carries `Events` to the listeners registered with it."""
    hub = pluggy.PluginManager(PROJECT)
    hub.add_hookspecs(Events)
    return hub


USAGE = "usage: python -m core.plugins [--check NAME]"


def main() -> None:
    """Print a table of every part, and what failed to load; with ``--check NAME`` run the conformance suites of the
    parts of that name, or of all parts of the plugin or distribution NAME.

    Raises:
        UserError: there is no such part, or it fails a check.
    """
    match sys.argv[1:]:
        case []:
            _list()
        case ["--check", name]:
            _check(name)
        case ["--help" | "-h"]:
            sys.stdout.write(f"{USAGE}\n")
        case words:
            raise UsageError(f"can't read {' '.join(words)!r}; {USAGE}")


def _check(name: str) -> None:
    found = installed()
    asked = [offer for offer in found.offers.values() if name in (offer.name, offer.entry_point, offer.distribution)]
    failures = [failure for failure in found.failures if name in (failure.entry_point, failure.distribution)]
    for failure in failures:
        sys.stdout.write(f"{failure.entry_point} of {failure.distribution}: {failure.reason}\n")
    if not asked and not failures:
        names = {key for o in found.offers.values() for key in (o.name, o.entry_point, o.distribution)}
        raise choices("part, plugin or distribution", name, names)
    for offer in asked:
        if offer.kind not in INTERFACES:
            found.create(offer.kind, offer.name)  # listeners may do what they like; that they hear events is checked
            sys.stdout.write(f"{offer.kind} {offer.name}: can be made, and hears events\n")
    words = [f"{offer.kind}={offer.name}" for offer in asked if offer.kind in INTERFACES]
    if failures:
        raise UserError(f"{len(failures)} of the plugin's hooks failed")
    failed = 0
    for word in words:
        sys.stdout.write(f"{word}\n")
        sys.stdout.flush()
        failed += subprocess.run([sys.executable, "-m", "core.conformance", word]).returncode != 0  # noqa: S603
    if failed:
        raise UserError(f"{failed} of {len(words)} parts don't do what they must")


def _list() -> None:
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
    command(main)

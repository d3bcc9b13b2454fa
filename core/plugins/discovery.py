"""Find plugins by their entry points, and collect what they offer.

An entry point that fails to load is kept with its reason, and the others are not affected.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pluggy

from core.errors import RAISED, UserError, choices
from core.hooks import PROJECT, Command, Configs, Factory, Parts
from core.plugins.kinds import KINDS

SWITCH = "VLMGINEER_PLUGINS"
"""The environment variable that names the plugins to load, by entry point or distribution, separated by commas."""

OWN = "core"
"""The entry point of core's own commands, which is never switched off."""

HOOKS = {kind.hook: kind.name for kind in KINDS.values()}
"""The kind of part that each hook of `core.hooks.Parts` offers."""

PACKAGES = ("core", "plugins", "tasks", "conf", "prompts")


@dataclass(frozen=True)
class Offer:
    """One part that can be made: its kind (config group) and name, the plugin that offers it, and its factory."""

    kind: str
    name: str
    entry_point: str
    distribution: str
    factory: Factory | Command

    def __str__(self) -> str:
        return f"{self.kind} {self.name!r} of {self.distribution} (hook {KINDS[self.kind].hook!r})"


@dataclass(frozen=True)
class Failure:
    """A plugin, or one of its hooks, that could not be used, and why."""

    entry_point: str
    distribution: str
    reason: str


class Discovery:
    """The installed plugins: ``offers`` by (kind, name), ``extensions`` likewise, packages of Hydra
    ``configs`` by distribution, ``failures``.

    Raises:
        UsageError: the environment variable `SWITCH` names a plugin that is not installed.
    """

    def __init__(self, entry_points: Mapping[str, Any] | None = None) -> None:
        self.offers: dict[tuple[str, str], Offer] = {}
        self.extensions: dict[tuple[str, str], Offer] = {}
        self.configs: dict[str, list[str]] = {}
        self.failures: list[Failure] = []
        for entry, distribution in _switched_on():
            try:
                module = entry.load()
            except RAISED as error:  # a third-party import may raise anything
                self.failures.append(
                    Failure(entry.name, distribution, f"import failed: {type(error).__name__}: {error}")
                )
            else:
                self.register(module, entry.name, distribution)
        for name, module in (entry_points or {}).items():
            self.register(module, name, "this process")

    def register(self, plugin: Any, name: str, distribution: str) -> None:
        """Add the offers of ``plugin``, a module or an object, as if an entry point ``name`` had named it."""
        manager = pluggy.PluginManager(PROJECT)
        manager.add_hookspecs(Parts)
        manager.add_hookspecs(Configs)
        try:
            manager.register(plugin, name)
        except pluggy.PluginValidationError as error:
            self.failures.append(Failure(name, distribution, " ".join(str(error).split())))
            return
        hooks = [caller for caller in manager.get_hookcallers(plugin) or () if caller.has_spec()]
        if not hooks:
            where = getattr(plugin, "__file__", None) or f"{type(plugin).__module__}.{type(plugin).__qualname__}"
            reason = f"{where} implements no hook; possible: {', '.join(HOOKS)}"
            self.failures.append(Failure(name, distribution, reason))
        for hook in hooks:
            try:
                for given in hook():
                    self._add(hook.name, given, name, distribution)
            except RAISED as error:  # a third-party hook may raise anything
                reason = f"hook {hook.name!r} failed: {type(error).__name__}: {error}"
                self.failures.append(Failure(name, distribution, reason))

    def _add(self, hook: str, given: Any, entry_point: str, distribution: str) -> None:
        """Add what a hook returned."""
        if hook == "config_path":
            _check_config_path(given)
            self.configs.setdefault(distribution, []).append(given)
            return
        offers = self.offers if hook in HOOKS else self.extensions
        kind = HOOKS.get(hook, hook.removesuffix("s"))
        for part, factory in dict(given).items():
            offer = Offer(kind, part, entry_point, distribution, factory)
            problem = _problem(offer, offers.get((kind, part)))
            if problem is None:
                offers[kind, part] = offer
            else:
                self.failures.append(Failure(entry_point, distribution, f"{kind} {part!r} {problem}"))


def _problem(offer: Offer, taken: Offer | None) -> str | None:
    """Say why an offer can't be taken; None: it can."""
    if offer.kind == "command" and not isinstance(offer.factory, Command):
        return f"is {offer.factory!r}; it must be a core.hooks.Command"
    if offer.kind != "command" and not isinstance(offer.factory, str) and not callable(offer.factory):
        return f"is {offer.factory!r}; it must be callable, or a text 'module:attribute'"
    if taken is not None:
        return f"is taken by {taken.entry_point} of {taken.distribution}"
    return None


def _switched_on() -> list[tuple[importlib.metadata.EntryPoint, str]]:
    """Return the entry points to load with their distributions: all of them, or those that `SWITCH` names.

    This project's own come first: the first offer of a name is kept, and no other package may replace a built-in part.
    """
    entries = importlib.metadata.entry_points(group=PROJECT)
    found = [(entry, entry.dist.name if entry.dist else "?") for entry in entries]
    found.sort(key=lambda pair: pair[1] != PROJECT)
    switch = os.environ.get(SWITCH)
    if switch is None:
        return found
    chosen = {OWN, *(name.strip() for name in switch.split(","))} - {""}
    known = {OWN}.union(*((entry.name, distribution) for entry, distribution in found))
    for name in sorted(chosen - known):
        raise choices("plugin or distribution", name, known, f"{SWITCH}={switch}")
    return [(entry, distribution) for entry, distribution in found if chosen & {entry.name, distribution}]


def check_own_packages() -> None:
    """Refuse a module on the import path that hides one of this project's packages.

    Raises:
        UserError: the message names the module's file, and says what to do.
    """
    home = Path(__file__).resolve().parents[2]
    for name in PACKAGES:
        spec = importlib.util.find_spec(name)
        origin = Path(spec.origin).resolve() if spec is not None and spec.origin else None
        if origin is not None and origin != home / name / "__init__.py":
            raise UserError(
                f"{origin} hides VLMgineer's own package {name!r}, which is in {home}; rename it, or run the command "
                "'vlmgineer NAME ...', which does not import from the working directory"
            )


def _check_config_path(path: object) -> None:
    """Refuse anything but the name of an installed package.

    Raises:
        ValueError: the message says what is expected.
    """
    expected = 'expected a package that holds YAML files, "pkg://my_package.conf"'
    if not isinstance(path, str) or not path.startswith("pkg://"):
        raise ValueError(f"it gave {path!r}; {expected}")
    package = path.removeprefix("pkg://").replace("/", ".")
    if importlib.util.find_spec(package) is None:  # raises where a package above is missing
        raise ValueError(f"there is no package {package!r}; {expected}")

"""Find plugins by their entry points, and collect what they offer.

An entry point that fails to load is kept with its reason, and the others are not affected.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pluggy

from core.hooks import PROJECT, Configs, Factory, Parts
from core.plugins.kinds import KINDS


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


class Discovery:
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

"""Load plugins by their entry points, and make the parts that they offer, by name and with checked settings."""

from __future__ import annotations

import importlib.metadata
import inspect
import pkgutil
import re
import typing
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar, TypeVar
from weakref import WeakKeyDictionary

import pluggy
from pydantic import ValidationError

from core.errors import RAISED, UsageError, UserError, choices, in_line
from core.hooks import PROJECT, Command, Configs, Factory, Parts
from core.interfaces import Robot, Task, ToolRepresentation
from core.plugins.kinds import COMMAND, HOOKS, KINDS, ROBOT, Kind
from core.plugins.loading import contained, find_usage
from core.plugins.packages import check_configs, refuse_hiding, refuse_rivals
from core.support.cli import answer_help
from core.support.inputs import adapter, find_mistakes
from core.values.materials import PAPER, Material
from core.values.printers import MK4, Printer

Settings = Mapping[str, Any] | None
_NAME = re.compile(r"\w[\w.-]{0,99}")
T = TypeVar("T")


@dataclass(frozen=True)
class Offer:
    """One part that can be made: its kind (config group) and name, the plugin that offers it, and its factory."""

    kind: str
    name: str
    entry_point: str
    distribution: str
    factory: Factory | Command

    @property
    def owner(self) -> str:
        """The part and the package that it comes from, for a message."""
        return f"{self.kind} {self.name!r} of {self.distribution}"

    def __str__(self) -> str:
        return f"{self.owner} (hook {KINDS[self.kind].hook!r})"


@dataclass(frozen=True)
class Failure:
    """A plugin, or one of its hooks, that could not be used, and why."""

    entry_point: str
    distribution: str
    reason: str


class Plugins:
    """The installed plugins; makes their parts.

    A plugin is a module or an object that an entry point names. Its hooks (`core.hooks`) are called once, when it is
    found. One that fails is kept in ``failures`` with the reason, and the others are not affected::

        plugins = installed()
        task = plugins.create(TASK, "BringCube", {"variation": "wide"})

    Attributes:
        offers: what is offered, by kind and name. The first offer of a name is kept.
        configs: packages of Hydra configs, each with the distribution that names it.
        failures: what could not be loaded.
    """

    _origins: ClassVar[WeakKeyDictionary[Any, Offer]] = WeakKeyDictionary()

    def __init__(self) -> None:
        self.offers: dict[tuple[str, str], Offer] = {}
        self.configs: dict[str, str] = {}
        self.failures: list[Failure] = []

        entries = importlib.metadata.entry_points(group=PROJECT)
        found = [(entry, entry.dist.name if entry.dist else "?") for entry in entries]
        # This project's own come first: no other package replaces a built-in part.
        for entry, distribution in sorted(found, key=lambda pair: pair[1] != PROJECT):
            try:
                with contained(f"loading the plugin {entry.name} of {distribution}"):
                    plugin = entry.load()
            except RAISED as error:  # a third-party import may raise anything
                reason = f"import failed: {in_line(error)}"
                self.failures.append(Failure(entry.name, distribution, reason))
            else:
                self.register(plugin, entry.name, distribution)

    def register(self, plugin: Any, name: str, distribution: str) -> None:
        """Add the offers of ``plugin``, a module or an object, as if an entry point ``name`` had named it."""

        def fail(reason: str) -> None:
            self.failures.append(Failure(name, distribution, reason))

        manager = pluggy.PluginManager(PROJECT)
        manager.add_hookspecs(Parts)
        manager.add_hookspecs(Configs)

        try:
            manager.register(plugin, name)
            manager.check_pending()
        except pluggy.PluginValidationError as error:
            fail(" ".join(str(error).split()))
            return

        hooks = manager.get_hookcallers(plugin) or []
        if not hooks:
            fail(f"{plugin!r} implements no hook; possible: {', '.join(HOOKS)}")
        for hook in hooks:
            try:
                with contained(f"asking the plugin {name} of {distribution}"):
                    offers = [_read_offer(hook.name, offered) for offered in hook()]
                for offered in offers:
                    if isinstance(offered, str):
                        check_configs(offered)
                        self.configs.setdefault(offered, distribution)
                        continue
                    for part, factory in offered.items():
                        kind = HOOKS[hook.name]
                        offer = Offer(kind, part, name, distribution, factory)
                        first = self.offers.setdefault((kind, part), offer)
                        if first is not offer:
                            owner = f"{first.entry_point} of {first.distribution}"
                            fail(f"{kind} {part!r} is taken by {owner}")
            except RAISED as error:  # a third-party hook may raise anything
                fail(f"hook {hook.name!r} failed: {in_line(error)}")

    def names(self, kind: str) -> list[str]:
        """Return the names of the parts of a kind, sorted."""
        return sorted(name for group, name in self.offers if group == kind)

    def factory(self, kind: str, name: str, where: str = "") -> Callable[..., Any]:
        """Return the factory of the part ``name`` of a kind, or of what a hook of `core.hooks.Configs` offers.

        Raises:
            UserError: there is none of that name, which a setting ``where`` gave; or it can't be imported.
        """
        offer = self.offers.get((kind, name))
        if offer is None:
            raise UsageError(
                f"{choices(kind, name, self.names(kind), where)}{self.failed}"
            )

        if isinstance(offer.factory, Command):
            return lambda: offer.factory
        return _imported(offer, offer.factory)

    @classmethod
    def origin(cls, part: object) -> Offer | None:
        """Return the offer that a part was made from; None: it was not made here."""
        with suppress(TypeError):  # it can't be a key
            return cls._origins.get(part)
        return None

    @property
    def failed(self) -> str:
        """What failed to load, to be added to an error about something that is not there."""
        return "".join(
            f"; plugin {failure.entry_point!r} failed: {failure.reason}"
            for failure in self.failures
        )

    def factories(self, kind: str) -> dict[str, Callable[..., Any]]:
        """Return all factories of a kind by name; see `factory`."""
        return {name: self.factory(kind, name) for name in self.names(kind)}

    def run_command(self, name: str, arguments: list[str]) -> int | None:
        """Call a command with its arguments, and return its exit status; None: 0.

        Raises:
            UserError: there is no command of that name, it can't be imported, or what it raises itself.
        """
        command = self.create(COMMAND, name)
        if arguments in (["--help"], ["-h"]) and isinstance(command.main, str):
            usage = find_usage(command.main)
            if usage:
                answer_help(usage, arguments)

        main = _imported(self.offers["command", name], command.main)
        return typing.cast(int | None, main(arguments))

    def create(
        self,
        kind: Kind[T],
        name: str,
        settings: Settings = None,
        *,
        robot: Robot | None = None,
        material: Material = PAPER,
        printer: Printer = MK4,
        **given: Any,
    ) -> T:
        """Make a part: check ``settings`` against its factory's signature, and call that with them and ``given``.

        A task or tool representation is made for ``robot``, by default for the default one, weighs by ``material``, and
        has its tools made by ``printer``.

        Raises:
            UserError: no such part; a setting that is unknown, missing or of the wrong type; or the factory makes
                no part of that kind. The message names the distribution.
        """
        group = str(kind)
        factory = self.factory(group, name)
        offer = self.offers[group, name]
        try:
            checked = check_settings(factory, settings or {}, f"{group}={name}", given)
            with contained():
                part = factory(**checked, **given)
        except UserError:
            raise
        except RAISED as error:  # a third-party factory may raise anything
            raise UserError(f"{offer} can't be made: {in_line(error)}") from error

        with suppress(TypeError):  # one that can't be a key is described by its class
            self._origins[part] = offer
        if isinstance(part, Task | ToolRepresentation):
            part.robot = robot or self.default_robot
        if isinstance(part, Task) and part.payload_kg is not None:
            payload_kg = min(part.payload_kg, part.robot.payload_kg)
            part.robot = replace(part.robot, payload_kg=payload_kg)
        if isinstance(part, ToolRepresentation):
            part.material = material
            part.printer = printer

        KINDS[group].check(part, str(offer))
        return typing.cast(T, part)

    @cached_property
    def default_robot(self) -> Robot:
        """The first robot that is offered, one of this project's own if it offers any.

        Raises:
            UserError: no plugin offers a robot.
        """
        for kind, name in self.offers:
            if kind == "robot":
                return self.create(ROBOT, name)
        raise UserError(
            "no robot is installed; python -m core.plugins lists what is, and what failed to load"
        )


def _read_offer(hook: str, offered: Any) -> str | dict[str, Any]:
    """Return what a hook gave: parts by their names, or where configs are.

    Raises:
        ValueError: it is neither.
    """
    if hook == "config_path":
        return str(offered)

    parts = dict(offered)
    for name, factory in parts.items():
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise ValueError(
                f"{name!r} is no name; use letters, digits, '_', '-' and '.'"
            )
        if hook == COMMAND.hook and not isinstance(factory, Command):
            raise TypeError(f"{name!r} is no core.hooks.Command")
        if not (isinstance(factory, str | Command) or callable(factory)):
            raise TypeError(f'{name!r} is neither callable nor "module:attribute"')

    return parts


def check_settings(
    factory: Callable[..., Any],
    settings: Mapping[str, Any],
    where: str,
    given: Mapping[str, Any],
) -> dict[str, Any]:
    """Convert ``settings`` to the types that the factory's signature names; the program gives others itself.

    Raises:
        UserError: a setting that is unknown, missing, or of the wrong type.
    """
    possible = settings_of(factory, given)
    hints = hints_of(factory)
    checked: dict[str, Any] = {}
    for name, value in settings.items():
        if name not in possible:
            raise choices("setting", name, possible, where)
        wanted = hints.get(name, Any)
        try:
            checked[name] = adapter(wanted).validate_python(value)
        except ValidationError as error:
            first = find_mistakes(wanted, error)[0]
            mend = f"; in a shell '\"{value}\"'" if first.kind == "string_type" else ""
            raise UsageError(
                f"{where}: setting {name!r} can't be {value!r}: {first}{mend}"
            ) from error

    for name, parameter in possible.items():
        if parameter.default is parameter.empty and name not in checked:
            raise UsageError(
                f"{where}: setting {name!r} is needed; settings: {', '.join(possible)}"
            )

    return checked


def settings_of(
    factory: Callable[..., Any], given: Collection[str] = ()
) -> dict[str, inspect.Parameter]:
    """Return the parameters of a factory that are settings: those with a name, but for what the program gives."""
    return {
        name: parameter
        for name, parameter in inspect.signature(factory).parameters.items()
        if parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)
        and name not in given
    }


def hints_of(factory: Callable[..., Any]) -> dict[str, Any]:
    """Return the types of a factory's parameters by their names, with what is noted in them."""
    function = factory.__init__ if inspect.isclass(factory) else factory
    return typing.get_type_hints(function, include_extras=True)


def _imported(offer: Offer, what: Callable[..., Any] | str) -> Callable[..., Any]:
    """Import what a text ``"module:attribute"`` names.

    Raises:
        UserError: it can't be imported.
    """
    if not isinstance(what, str):
        return what

    try:
        with contained(f"importing {offer.owner}"):
            return typing.cast(Callable[..., Any], pkgutil.resolve_name(what))
    except UserError:
        raise
    except RAISED as error:  # a third-party import may raise anything
        raise UserError(f"{offer.owner} can't be imported: {in_line(error)}") from error


def describe_part(part: object) -> str:
    """Name a part that was made here by its kind, name, distribution and hook; others by their class."""
    return str(
        Plugins.origin(part) or f"{type(part).__module__}.{type(part).__qualname__}"
    )


@lru_cache(maxsize=1)
def installed() -> Plugins:
    """Find the plugins of this environment, once per process.

    Raises:
        UserError: another folder or package stands in the place of one of this program's.
    """
    refuse_hiding()
    plugins = Plugins()
    if any(failure.distribution == PROJECT for failure in plugins.failures):
        refuse_rivals()
    return plugins

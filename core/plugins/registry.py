"""Make parts by name, with their settings checked."""

from __future__ import annotations

import contextlib
import importlib
import inspect
import math
import os
import typing
import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Generic, overload

import pydantic
from typing_extensions import TypeVar

from core.errors import RAISED, UsageError, UserError, choices
from core.geometry import Pose
from core.hooks import PROJECT, Command
from core.interfaces import Robot, Task, ToolRepresentation
from core.plugins.discovery import SWITCH, Discovery, Offer, check_own_packages
from core.plugins.kinds import COMMAND, KINDS, ROBOT, Kind
from core.values.materials import PAPER, Material

_NAMED = ("missing", "unexpected_keyword_argument")  # errors about a key of a setting, which their text doesn't name
Settings = Mapping[str, Any] | None
T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True, default=Any)


class Plugins(Discovery):
    """The installed plugins; makes their parts."""

    def names(self, kind: str) -> list[str]:
        """Return the names of the parts of a kind, sorted."""
        return sorted(name for group, name in self.offers if group == kind)

    def ready(self, kind: str) -> list[str]:
        """Return the names of the parts of a kind that can be made without settings, sorted."""
        return [name for name in self.names(kind) if not _needed(inspect.signature(self.factory(kind, name)))]

    def factory(self, kind: str, name: str) -> Callable[..., Any]:
        """Return the factory of the part ``name`` of a kind.

        Raises:
            UserError: there is no part of that name, or it can't be imported.
        """
        offer = self.offers.get((kind, name))
        if offer is None:
            raise UserError(f"{choices(kind, name, self.names(kind))}{self._missing()}")
        if isinstance(offer.factory, Command):
            return lambda command=offer.factory: command
        return _imported(offer, offer.factory)

    def extension(self, kind: str, name: str, where: str = "") -> Any:
        """Import what is offered by a hook of `core.hooks.Configs`, such as a ``level``.

        Raises:
            UserError: there is none, named in a setting ``where``, or it can't be imported.
        """
        offers = {other: offer for (own, other), offer in self.extensions.items() if own == kind}
        if name not in offers:
            raise UsageError(f"{choices(kind, name, offers, where)}{self._missing()}")
        return _imported(offers[name], offers[name].factory)  # type: ignore[arg-type]

    def _missing(self) -> str:
        """Say why something may not be there."""
        failed = "".join(f"; plugin {f.entry_point!r} failed to load: {f.reason}" for f in self.failures)
        return failed + (f"; {SWITCH}={os.environ[SWITCH]} leaves out other plugins" if SWITCH in os.environ else "")

    def extensions_of(self, kind: str) -> dict[str, Any]:
        """Import all that is offered by such a hook, by name; see `extension`."""
        return {name: self.extension(kind, name) for own, name in self.extensions if own == kind}

    def run_command(self, name: str, arguments: list[str]) -> int | None:
        """Call a command with its arguments, and return its exit status; None: 0.

        Raises:
            UserError: there is no command of that name, it can't be imported, or what it raises itself.
        """
        command = self.create(COMMAND, name)
        main: Callable[[list[str]], int | None] = _imported(self.offers["command", name], command.main)
        return main(arguments)

    @overload
    def create(self, kind: Kind[T], name: str, settings: Settings = ..., **given: Any) -> T: ...
    @overload
    def create(self, kind: str, name: str, settings: Settings = ..., **given: Any) -> Any: ...
    def create(
        self,
        kind: Kind[Any] | str,
        name: str,
        settings: Settings = None,
        *,
        robot: Robot | None = None,
        material: Material = PAPER,
        **given: Any,
    ) -> Any:
        """Make a part: check ``settings`` against its factory's signature, and call that with them and ``given``.

        A task or tool representation is made for ``robot``, by default for the default one, and weighs by ``material``.

        Raises:
            UserError: no such part; a setting that is unknown, missing or of the wrong type; or the factory makes
                no part of that kind. The message names the distribution.
        """
        group = str(kind)
        factory, offer = self.factory(group, name), self.offers[group, name]
        checked = check_settings(factory, settings or {}, f"{group}={name}", given)
        left = sorted(getattr(factory, "__abstractmethods__", ()))
        if left:
            raise UserError(f"{offer} can't be made: {factory.__qualname__} lacks {', '.join(left)}")
        try:
            part = factory(**checked, **given)
        except (UserError, KeyboardInterrupt):
            raise
        except RAISED as error:  # a third-party factory may raise anything
            raise UserError(f"{offer} can't be made: {type(error).__name__}: {error}") from error
        KINDS[group].check(part, str(offer))
        with contextlib.suppress(TypeError):  # a part that can't be a key is described by its class
            _made[part] = offer
        if isinstance(part, Task | ToolRepresentation):
            part.robot = robot or self.default_robot
        if isinstance(part, ToolRepresentation):
            part.material = material
        return part

    @cached_property
    def default_robot(self) -> Robot:
        """The first robot that this project's own plugins offer, or else the first that any offers.

        Raises:
            UserError: no plugin offers a robot.
        """
        offers = [offer for offer in self.offers.values() if offer.kind == "robot"]
        if not offers:
            raise UserError("no robot is installed; python -m core.plugins lists what is, and what failed to load")
        first = next((offer for offer in offers if offer.distribution == PROJECT), offers[0])
        return self.create(ROBOT, first.name)


def check_settings(
    factory: Callable[..., Any], settings: Mapping[str, Any], where: str, given: Mapping[str, Any]
) -> dict[str, Any]:
    """Convert ``settings`` to the types that the factory's signature names.

    Raises:
        UserError: a setting that is unknown, missing, or of the wrong type.
    """
    signature = inspect.signature(factory)
    parameters = [
        name
        for name, parameter in signature.parameters.items()
        if name not in given and parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)
    ]
    hints = typing.get_type_hints(factory.__init__ if inspect.isclass(factory) else factory)
    checked: dict[str, Any] = {}
    for name, value in settings.items():
        if name not in parameters:
            raise choices("setting", name, parameters, where)
        try:
            checked[name] = pydantic.TypeAdapter(hints.get(name, Any)).validate_python(value)
        except pydantic.ValidationError as error:
            first = error.errors()[0]
            reason = f"{first['msg']}: {first['loc'][-1]}" if first["type"] in _NAMED else first["msg"]
            raise UsageError(f"{where}: setting {name!r} can't be {value!r}: {reason}") from error
    for name in _needed(signature):
        if name not in checked and name not in given:
            raise UsageError(f"{where}: setting {name!r} is needed; settings: {', '.join(parameters)}")
    return checked


def _needed(signature: inspect.Signature) -> list[str]:
    """Return the names of the parameters without a default."""
    return [
        name
        for name, parameter in signature.parameters.items()
        if parameter.default is parameter.empty
        and parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
    ]


def _imported(offer: Offer, what: Callable[..., Any] | str) -> Callable[..., Any]:
    """Import what a text ``"module:attribute"`` names.

    Raises:
        UserError: it can't be imported.
    """
    if not isinstance(what, str):
        return what
    module, _, attribute = what.partition(":")
    try:
        return typing.cast(Callable[..., Any], getattr(importlib.import_module(module), attribute))
    except RAISED as error:  # a third-party import may raise anything
        reason = f"can't be imported: {type(error).__name__}: {error}"
        raise UserError(f"{offer.kind} {offer.name!r} of {offer.distribution} {reason}") from error


_made: weakref.WeakKeyDictionary[Any, Offer] = weakref.WeakKeyDictionary()


def offer_of(part: object) -> Offer | None:
    """Return the offer that a part was made from; None: it was not made here."""
    with contextlib.suppress(TypeError):  # it can't be a key
        return _made.get(part)
    return None


def describe_part(part: object) -> str:
    """Name a part that was made here by its kind, name, distribution and hook; others by their class."""
    offer = offer_of(part)
    return str(offer) if offer is not None else f"{type(part).__module__}.{type(part).__qualname__}"


@lru_cache(maxsize=1)
def installed() -> Plugins:
    """Find the plugins of this environment, once per process.

    Raises:
        UserError: a module hides one of this project's packages, or `SWITCH` names a plugin that is not installed.
    """
    check_own_packages()
    return Plugins()


@dataclass(frozen=True)
class PluginPart(Generic[T_co]):
    """A part by name and settings, from which a worker process makes its own; ``PluginPart[Task]`` makes a `Task`.

    A task or tool representation is made for ``robot`` (None: the default robot) and weighs by ``material``.
    """

    kind: str
    name: str
    settings: tuple[tuple[str, Any], ...] = ()
    robot: RobotPart | None = None
    material: Material = PAPER

    def __hash__(self) -> int:  # settings may be lists and mappings
        return hash((self.kind, self.name))

    def create(self, **given: Any) -> T_co:
        made_for = {"robot": self.robot and _robot(self.robot), "material": self.material}
        part: T_co = installed().create(self.kind, self.name, dict(self.settings), **(made_for | given))
        return part


@dataclass(frozen=True)
class RobotPart(PluginPart[Robot]):
    """A robot by name and settings, and where its base stands: x, y, z in metres, and yaw in radians."""

    base: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    __hash__ = PluginPart.__hash__

    def create(self, **given: Any) -> Robot:
        return replace(super().create(**given), base=self.pose)

    @property
    def pose(self) -> Pose:
        """The base's pose in the world.

        Raises:
            UsageError: ``base`` is not four finite numbers.
        """
        numbers = [n for n in self.base if isinstance(n, int | float) and not isinstance(n, bool) and math.isfinite(n)]
        if len(numbers) != 4 or len(self.base) != 4:
            raise UsageError(f"robot.base must be four numbers, [x, y, z, yaw], got {list(self.base)}")
        return Pose.xyz_rpy(numbers[:3], (0.0, 0.0, numbers[3])) if any(numbers) else Pose()


@lru_cache(maxsize=16)
def _robot(part: RobotPart) -> Robot:
    """Make a robot once per process, so that what is computed from it is found again."""
    return part.create()

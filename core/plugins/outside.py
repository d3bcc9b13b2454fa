"""Find the settings of a part that may name something outside of the program: a program, an address, a file, a key."""

from __future__ import annotations

import types
import typing
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import is_dataclass
from enum import Enum
from typing import Any, NamedTuple

from core.errors import UserError
from core.plugins.kinds import KINDS
from core.plugins.registry import hints_of, installed, settings_of
from core.values.harmless import IsHarmless, Names, PartsOf

_SCALARS = (bool, int, float)
_TEXT = "text"  # of which nobody says what it names


class Found(NamedTuple):
    """A setting that may name something outside.

    Attributes:
        path: its whole name, such as ``vlm.command``.
        value: of it.
        what: it names, in a word or two.
    """

    path: str
    value: Any
    what: str = _TEXT


def outside_part(kind: str, settings: object, where: str) -> Iterator[Found]:
    """Yield the settings of a part that may name something outside.

    A setting is harmless that has the part's default, or whose type says so (`core.values.harmless`). Of a part that
    is not installed nothing is used.

    Args:
        kind: of the part.
        settings: its ``name``, and its settings.
        where: the path of the part in a configuration.
    """
    if not isinstance(settings, Mapping):
        if not _is_plain(settings):
            yield Found(where, settings)
        return

    try:
        factory = installed().factory(kind, str(settings.get("name")))
    except UserError:  # nothing can be made of it
        return

    hints: dict[str, Any] = {}
    usual: dict[str, Any] = dict(KINDS[kind].defaults)
    with suppress(TypeError, ValueError, NameError):  # of a plugin's signature
        hints = hints_of(factory)
        for name, parameter in settings_of(factory, KINDS[kind].provided).items():
            usual[name] = parameter.default

    for name, value in settings.items():
        is_usual = name in usual and _equal(value, usual[name])
        known = name == "name" or (name in KINDS[kind].defaults and name not in hints)
        hint = hints.get(name, Any)
        if not (is_usual or known) and is_outside(value, hint):
            yield Found(f"{where}.{name}", value, describe(hint))


def list_readers(kind: str, file: str) -> list[str]:
    """List what to type so that a part reads a file, such as ``task=file task.file=scene.yaml``."""
    words = []
    for name, factory in installed().factories(kind).items():
        for setting, hint in hints_of(factory).items():
            if describe(hint) == "file":
                words.append(f"{kind}={name} {kind}.{setting}={file}")

    return words


def describe(kind: Any) -> str:
    """Say what a setting of a type names outside, as far as it is declared."""
    for mark in getattr(kind, "__metadata__", ()):
        if isinstance(mark, Names):
            return mark.what
        if isinstance(mark, PartsOf):
            return f"parts, {mark.kind}"
    return _TEXT


def is_outside(value: object, kind: Any) -> bool:
    """Report whether a value of a type may name something outside: it has a text that its type doesn't speak for."""
    if _is_plain(value):
        return False

    if typing.get_origin(kind) is typing.Annotated:
        inner, *marks = typing.get_args(kind)
        for mark in marks:
            if isinstance(mark, IsHarmless):
                return False
            if isinstance(mark, PartsOf):
                return _is_part_outside(value, mark.kind)
        return is_outside(value, inner)

    arguments = typing.get_args(kind)
    origin = typing.get_origin(kind)
    if origin in (typing.Union, types.UnionType):
        return all(is_outside(value, choice) for choice in arguments)
    if origin is typing.Literal:
        return value not in arguments
    if isinstance(kind, type) and issubclass(kind, Enum):
        return False
    if isinstance(value, Mapping):
        return _is_mapping_outside(value, kind, arguments)
    if isinstance(value, list | tuple):
        item = arguments[0] if arguments else Any
        return any(is_outside(entry, item) for entry in value)

    return True


def _is_mapping_outside(
    value: Mapping[Any, Any], kind: Any, arguments: tuple[Any, ...]
) -> bool:
    """Judge a mapping: by the types of a class's fields, or by that of all values."""
    if is_dataclass(kind):
        fields = typing.get_type_hints(kind, include_extras=True)
        return any(is_outside(value[name], fields.get(name, Any)) for name in value)

    item = arguments[1] if len(arguments) == 2 else Any
    return any(is_outside(entry, item) for entry in value.values())


def _is_part_outside(value: object, kind: str) -> bool:
    """Judge parts, each by its own settings; a name alone says nothing but which part it is."""
    parts = value if isinstance(value, list | tuple) else [value]
    return any(
        next(outside_part(kind, part, ""), None) is not None
        for part in parts
        if not isinstance(part, str)
    )


def _is_plain(value: object) -> bool:
    """Report whether a value holds no text."""
    if isinstance(value, Mapping):
        return all(map(_is_plain, value.values()))
    if isinstance(value, list | tuple):
        return all(map(_is_plain, value))
    return value is None or value == "" or isinstance(value, _SCALARS)


def _equal(value: object, default: object) -> bool:
    if isinstance(default, tuple):
        default = list(default)
    return type(value) is type(default) and value == default

"""Check what comes from outside, such as settings, designs, files and stores, and say in one line what is wrong.

Pydantic checks it, by the types of a dataclass or a model. What is wrong is said the same way everywhere: the way to
the entry, what it must be, and what was given.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeVar, cast

from pydantic import ConfigDict, TypeAdapter, ValidationError, WrapValidator
from pydantic_core import ErrorDetails, PydanticCustomError

from core.errors import CodedError, Reason, Refusal, choices
from core.support.text import clean, shorten

T = TypeVar("T")
Entry = tuple[str | int, ...]
"""The way to an entry: keys of objects and numbers of items."""

STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)
"""No other keys than those that are known, and no text for a number."""

FIELDS = ConfigDict(extra="forbid")
"""No other keys than those that are known."""

_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
_BEYOND = ("less_than", "greater_than", "finite_number")  # its range
_LIST = "must be a list, such as [0, 0, 0.1]"
_OBJECT = "must be an object of keys and values, such as {radius: 0.1}"
_WORDS = {
    "missing": "is missing; add it",
    "bool_type": "must be true or false",
    "string_type": "must be a text; put it in quotes",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "list_type": _LIST,
    "tuple_type": _LIST,
    "dict_type": _OBJECT,
    "model_type": _OBJECT,
    "dataclass_type": _OBJECT,
    "string_pattern_mismatch": "must be a name of letters, digits and '_', a letter first",
}


class EntryReason(Reason):
    """What an entry of a file or a configuration breaks."""

    ENTRY_VALUE = "{where}: {problem}"
    ENTRY_MISSING = "{where}: it is missing"
    ENTRY_UNKNOWN = "{where}: there is no such key"
    ENTRY_WORD = "{where}: it must be true or false"
    ENTRY_TEXT = "{where}: it must be a text"
    ENTRY_NUMBER = "{where}: it must be a number"
    ENTRY_LIST = "{where}: it must be a list"
    ENTRY_OBJECT = "{where}: it must be an object"
    ENTRY_CHOICE = "{where}: it must be one of some words"
    ENTRY_RANGE = "{where}: it is beyond its range"
    ENTRY_LENGTH = "{where}: it is too long or too short"
    ENTRY_NAME = "{where}: it must be a name"


_REASONS = {
    EntryReason.ENTRY_MISSING: ("missing",),
    EntryReason.ENTRY_UNKNOWN: _UNKNOWN,
    EntryReason.ENTRY_WORD: ("bool_",),
    EntryReason.ENTRY_TEXT: ("string_type",),
    EntryReason.ENTRY_NUMBER: ("float_", "int_"),
    EntryReason.ENTRY_LIST: ("list_type", "tuple_type"),
    EntryReason.ENTRY_OBJECT: ("dict_type", "model_type", "dataclass_type"),
    EntryReason.ENTRY_CHOICE: ("literal_",),
    EntryReason.ENTRY_RANGE: _BEYOND,
    EntryReason.ENTRY_LENGTH: ("too_long", "too_short", "string_too_"),
    EntryReason.ENTRY_NAME: ("string_pattern_",),
}
"""The beginnings of Pydantic's kinds of mistakes, by the reason that they are."""

_SUBJECT = re.compile(r"^(Input|Tuple|Dictionary|List|String|Value) should ")
_LONGEST = 300  # characters of what is said
_GIVEN = 80  # and of what was given in it
_NO_TEXT = "it holds a character that is no text, such as half of a pair; leave it out"

_made: Callable[[Any], TypeAdapter[Any]] = lru_cache(maxsize=256)(TypeAdapter)


@dataclass(frozen=True)
class Mistake:
    """What is wrong with an entry.

    Attributes:
        where: the way to it.
        problem: what it must be, and the words to type.
        kind: of the mistake, as Pydantic names it.
        refusals: the same for programs.
    """

    where: Entry
    problem: str
    kind: str = ""
    refusals: tuple[Refusal, ...] = ()

    def __str__(self) -> str:
        place = clean(".".join(map(str, self.where)), _LONGEST)
        return f"{place}: {self.problem}" if place else self.problem


def adapter(kind: Any) -> TypeAdapter[Any]:
    """Return what checks a type, which is slow to make."""
    try:
        return _made(kind)
    except TypeError:  # notes of a plugin's type may be no keys
        return TypeAdapter(kind)


def check(
    kind: type[T],
    given: object,
    what: str = "",
    refuse: type[Exception] = ValueError,
) -> T:
    """Return what was given as a type has it.

    Args:
        kind: a dataclass, a model, or any type of annotations.
        given: what came from outside.
        what: words for it, which begin the message; empty: none are needed.
        refuse: the class of the error.

    Raises:
        Exception: ``refuse``, with the first mistake in one line.

    For example::

        check(Measure, {"name": "mass", "upper": 0.1}, "evolution.measures", UsageError)
    """
    try:
        return cast(T, adapter(kind).validate_python(given))
    except ValidationError as error:
        first = find_mistakes(kind, error)[0]
        refused = refuse(f"{what}: {first}" if what else str(first))
        if isinstance(refused, CodedError):
            refused.coded(*first.refusals)
        raise refused from error


def check_plain(kind: type[T], given: object) -> T:
    """Return what was read from YAML or JSON as a type has it, which may be strict: a list becomes a tuple.

    Raises:
        ValidationError: it does not fit (`find_mistakes`).
    """
    return cast(T, adapter(kind).validate_json(json.dumps(given)))


def find_mistakes(kind: Any, error: ValidationError) -> list[Mistake]:
    """List all that is wrong: keys that are unknown first, since they may be what is missing.

    Args:
        kind: the type that does not fit.
        error: of Pydantic's.
    """
    errors = error.errors(include_url=False)
    mistakes = []
    for entry in sorted(errors, key=lambda entry: entry["type"] not in _UNKNOWN):
        where = tuple(entry["loc"])
        problem = _explain(entry)
        if entry["type"] in _UNKNOWN:
            problem = str(
                choices("key", str(where[-1])[:100], keys_at(kind, where[:-1]))
            )
            lacks = [
                str(other["loc"][-1])
                for other in errors
                if other["type"] == "missing" and other["loc"][:-1] == where[:-1]
            ]
            if lacks:
                problem += f"; missing: {', '.join(lacks)}"

        refusals = _find_refusals(entry)
        mistakes.append(Mistake(where, problem, entry["type"], refusals))

    return mistakes


def _find_refusals(error: ErrorDetails) -> tuple[Refusal, ...]:
    """Return the code of a mistake: its own, or that of its kind with its place, its limits, and what was given."""
    context = dict(error.get("ctx", {}))
    cause = context.pop("error", None)
    where = ".".join(map(str, error["loc"]))
    if isinstance(cause, CodedError) and cause.refusals:
        return cause.placed("", where=where).refusals

    kind = error["type"]
    reason = EntryReason.ENTRY_VALUE
    for known, beginnings in _REASONS.items():
        if kind.startswith(beginnings):
            reason = known

    values = {name: value for name, value in context.items() if _is_plain(value)}
    if reason is EntryReason.ENTRY_VALUE:
        values["problem"] = _explain(error)
    if _is_plain(error["input"]):
        values["given"] = error["input"]
    return (reason.refusal(where=where, **values),)


def _is_plain(value: object) -> bool:
    return isinstance(value, str | int | float)


def _explain(error: ErrorDetails) -> str:
    """Say what an entry must be, and what was given."""
    given = error["input"]
    message = _WORDS.get(error["type"]) or _SUBJECT.sub("must ", error["msg"])
    message = message.removeprefix("Value error, ").replace(" after validation", "")
    if error["type"] == "json_invalid" and not error["loc"]:
        message = _NO_TEXT
    if isinstance(given, str | int | float) and "got" not in message:
        got = repr(given)
        message += f", got {got}" if len(got) < _GIVEN else f", got {shorten(got)}"

    return clean(message, _LONGEST)


def in_unit(words: str) -> WrapValidator:
    """Make what adds to the error of a number beyond its range in which unit it is, for its ``Annotated`` type.

    Args:
        words: such as ``it is in metres``.
    """

    def read(given: Any, handler: Callable[[Any], Any]) -> Any:
        try:
            return handler(given)
        except ValidationError as error:
            first = error.errors()[0]
            if not first["type"].startswith(_BEYOND):
                raise
            problem = f"{_explain(first)}; {words}"
            raise PydanticCustomError(
                first["type"],
                "{problem}",
                {**first.get("ctx", {}), "problem": problem},
            ) from error

    return WrapValidator(read)


def meant(words: str) -> WrapValidator:
    """Make what says in words of its own what an ``Annotated`` type may be.

    Args:
        words: such as ``give its number, from 0, or its name``.
    """

    def read(given: Any, handler: Callable[[Any], Any]) -> Any:
        try:
            return handler(given)
        except ValidationError as error:
            raise ValueError(words) from error

    return WrapValidator(read)


def keys_at(kind: Any, where: Entry) -> list[str]:
    """List the keys that are possible in the object at ``where``, in what a type describes."""
    schema = adapter(kind).json_schema()
    found = _alternatives(schema, schema)
    for step in where:
        below = []
        for node in found:
            inner = node.get("properties", {}).get(
                step, node.get("additionalProperties")
            )
            if isinstance(step, int):
                inner = node.get("items")
            if isinstance(inner, dict):
                below += _alternatives(inner, schema)

        found = below

    return sorted({key for node in found for key in node.get("properties", ())})


def _alternatives(node: dict[str, Any], schema: dict[str, Any]) -> list[dict[str, Any]]:
    """List the schemas of which what a node of the whole ``schema`` describes must fit one."""
    if "$ref" in node:
        name = node["$ref"].rpartition("/")[2]
        return _alternatives(schema["$defs"][name], schema)

    found = []
    for choice in node.get("anyOf", ()):
        found += _alternatives(choice, schema)

    return found or [node]

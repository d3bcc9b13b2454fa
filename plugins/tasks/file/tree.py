"""Read YAML as plain data, within limits, and note the line of each entry."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import ValidationError

from core.errors import CodedError, Refusal, UserError
from core.interfaces import JsonObject
from core.support.files import read_text
from core.support.inputs import EntryReason, check_plain, find_mistakes
from core.support.text import clean
from plugins.tasks.file.refusals import SceneReason

T = TypeVar("T")

MAX_BYTES = 100_000
MAX_DEPTH = 12

Where = tuple[str | int, ...]
"""The way to an entry: keys of objects and numbers of items."""

_NUMBER = re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?")
_PLACES = ("x", "y", "z")
_TURNS = ("roll", "pitch", "yaw")
_AXES = {"rpy_deg": _TURNS}
"""The names of a vector's numbers, by its key; those of others are `_PLACES`."""

MISSING = (
    "there is no such number; a range needs a number that is written in the file, such as bodies.cup.position.x, or "
    "of copies, bodies.ball_3.mass or bodies.ball_*.mass"
)
"""Why a path leads to no number."""

_WORDS = {"true": True, "false": False, "null": None, "~": None, "": None}


class Tree:
    """A YAML document as plain data: objects, lists, texts, numbers, true, false and null.

    Numbers and words are those of YAML 1.2, so that ``no`` is a text and ``1e-3`` a number.

    Attributes:
        file: as messages name it.
        data: the document.
        lines: the line of each entry, from 1.
        spans: where the text of each word and number begins and ends, in characters.

    Raises:
        UserError: the text is no such document, or too large.
    """

    def __init__(self, file: Path, text: str) -> None:
        self.file = file
        self.lines: dict[Where, int] = {}
        self.spans: dict[Where, tuple[int, int]] = {}
        try:
            self._check_events(text)
            root = yaml.compose(text, yaml.SafeLoader)
        except yaml.MarkedYAMLError as error:
            where = str(file)
            mark = error.problem_mark or error.context_mark
            if mark:
                where += f", line {mark.line + 1}"

            reason = clean(str(error.problem), 200)
            raise _no_yaml(where, reason) from error
        except (yaml.YAMLError, ValueError) as error:  # a character that YAML has not
            reason = clean(" ".join(str(error).split()), 200)
            raise _no_yaml(str(file), reason) from error

        if not isinstance(root, yaml.MappingNode):
            raise UserError.because(SceneReason.YAML_OBJECT, file=str(file))

        self.data: JsonObject = self._read(root, ())

    @classmethod
    def read(cls, file: Path) -> tuple[str, Tree]:
        """Read a file; return its text too.

        Raises:
            UserError: it can't be read.
        """
        text = read_text(file, f"scene file {file}", MAX_BYTES)
        return text, cls(file, text)

    def error(
        self,
        where: Where,
        message: str | CodedError,
        found: Sequence[Refusal] = (),
    ) -> UserError:
        """Build the error of an entry: file, line, way to it, and what is wrong.

        Args:
            where: the way to the entry.
            message: what is wrong, or the error that says so.
            found: its codes; none: those of the error, or that of any wrong value.
        """
        known = where
        while known and known not in self.lines:
            known = known[:-1]

        line = self.lines.get(known, 1)
        place = {"where": say(where).removesuffix(": "), "line": line}
        if isinstance(message, CodedError):
            found = found or message.refusals
        found = found or [EntryReason.ENTRY_VALUE.refusal(problem=str(message))]
        error = UserError(f"{self.file}, line {line}: {say(where)}{message}")
        return error.coded(
            *(Refusal(refusal.code, {**refusal.values, **place}) for refusal in found)
        )

    def check(self, kind: type[T], data: Mapping[str, Any]) -> T:
        """Return the document, or one with other numbers, as a type has it.

        Raises:
            UserError: the first thing that is wrong: the line, the way to it, and how to mend it.
        """
        try:
            return check_plain(kind, data)
        except ValidationError as error:
            first = find_mistakes(kind, error)[0]
            raise self.error(first.where, first.problem, first.refusals) from error

    def list_mistakes(self, kind: type, data: Mapping[str, Any]) -> list[str]:
        """List all that is wrong with what `check` is given, a line for each."""
        try:
            check_plain(kind, data)
        except ValidationError as error:
            return [
                str(self.error(mistake.where, mistake.problem))
                for mistake in find_mistakes(kind, error)
            ]

        return []

    def _check_events(self, text: str) -> None:
        """Refuse what would unfold, or make objects, before anything is built."""
        depth = 0
        event: Any
        for event in yaml.parse(text, yaml.SafeLoader):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            problem = _find_problem(event, depth)
            if problem is not None:
                line = event.start_mark.line + 1
                raise problem.placed(f"{self.file}, line {line}: ", line=line)

    def _read(self, node: Any, where: Where) -> Any:
        """Make plain data of a node, and note the lines of its entries."""
        self.lines.setdefault(where, node.start_mark.line + 1)
        if isinstance(node, yaml.SequenceNode):
            items = enumerate(node.value)
            return [self._read(item, (*where, number)) for number, item in items]

        if not isinstance(node, yaml.MappingNode):
            self.spans[where] = (node.start_mark.index, node.end_mark.index)
            return self._scalar(node, where)

        found: JsonObject = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise self.error(where, UserError.because(SceneReason.YAML_KEY))

            inner = (*where, key.value)
            self.lines[inner] = key.start_mark.line + 1

            if key.value in found:
                raise self.error(inner, UserError.because(SceneReason.YAML_TWICE))

            found[key.value] = self._read(value, inner)

        return found

    def _scalar(self, node: Any, where: Where) -> Any:
        """Read a text, number or word, as YAML 1.2 does."""
        text: str = node.value
        if node.style is not None:  # in quotes, or folded
            return text
        if text.lower() in _WORDS:
            return _WORDS[text.lower()]
        if not _NUMBER.fullmatch(text):
            return text
        if not math.isfinite(float(text)):
            given = clean(text, 60)
            problem = UserError.because(SceneReason.YAML_NUMBER, given=given)
            raise self.error(where, problem)
        if re.fullmatch(r"[-+]?[0-9]{1,15}", text):
            return int(text)

        return float(text)


def as_coded(error: Exception) -> str | CodedError:
    """Return an error that has codes as it is, and of another what it says."""
    return error if isinstance(error, CodedError) else str(error)


def _no_yaml(where: str, problem: str) -> UserError:
    return UserError.because(SceneReason.NO_YAML, file=where, problem=problem)


def _find_problem(event: Any, depth: int) -> UserError | None:
    """Say what of a YAML document's event is not read; None: all of it is."""
    tag = clean(getattr(event, "tag", None) or "", 60)
    if tag:
        return UserError.because(SceneReason.YAML_TAG, tag=tag)

    anchor = clean(getattr(event, "anchor", None) or "", 60)
    if anchor:
        return UserError.because(SceneReason.YAML_ANCHOR, anchor=anchor)
    if depth > MAX_DEPTH:
        return UserError.because(SceneReason.YAML_DEPTH, most=MAX_DEPTH)

    return None


def say(where: Where) -> str:
    """Write the way to an entry, such as ``bodies[2].mass: ``."""
    if not where:
        return ""

    found = ""
    for step in where:
        if isinstance(step, int):
            found += f"[{step}]"
        else:
            found += f".{clean(step, 60)}"

    return f"{found.lstrip('.')}: "


def follow(data: Mapping[str, Any], path: str) -> tuple[Any, str | int]:
    """Find a number by a path such as ``bodies.cup.position.x``; return what holds it, and its key there.

    Items of a list are found by name, by number, or in a vector by axis.

    Raises:
        KeyError: there is no such number.
    """
    node: Any = data
    holder: Any = None
    key: str | int = ""
    name = ""
    for step in path.split("."):
        holder = node
        key = step
        if isinstance(node, list):
            key = find_item(node, step, _AXES.get(name, _PLACES))
        name = step

        node = holder[key]

    if isinstance(node, bool) or not isinstance(node, int | float):
        raise KeyError(path)

    return holder, key


def find_item(items: list[Any], step: str, axes: Sequence[str]) -> int:
    """Return the number of an item that a step of a path leads to; ``axes`` are the names of a vector's numbers.

    Raises:
        ValueError: the step is neither a name, nor an axis, nor a number.
    """
    for number, item in enumerate(items):
        if isinstance(item, dict) and item.get("name") == step:
            return number

    if step in axes:
        return axes.index(step)

    return int(step)

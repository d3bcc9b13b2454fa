"""Read YAML as plain data, within limits, and note the line of each entry."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from core.errors import UserError
from core.support.files import read_untrusted
from core.support.text import clean

MAX_BYTES = 100_000
MAX_DEPTH = 12

Where = tuple[str | int, ...]
"""The way to an entry: keys of objects and numbers of items."""

_NUMBER = re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?")
_WORDS = {"true": True, "false": False, "null": None, "~": None, "": None}


class Tree:
    """A YAML document as plain data: objects, lists, texts, numbers, true, false and null.

    Numbers and words are those of YAML 1.2, so that ``no`` is a text and ``1e-3`` a number.

    Attributes:
        file: as messages name it.
        data: the document.
        lines: the line of each entry, from 1.

    Raises:
        UserError: the text is no such document, or too large.
    """

    def __init__(self, file: Path, text: str) -> None:
        self.file = file
        self.lines: dict[Where, int] = {}
        try:
            self._check_events(text)
            root = yaml.compose(text, yaml.SafeLoader)
        except yaml.MarkedYAMLError as error:
            at = error.problem_mark or error.context_mark
            where = f", line {at.line + 1}" if at else ""
            raise UserError(
                f"{file}{where}: this is no YAML: {clean(str(error.problem), 200)}"
            ) from error
        except (yaml.YAMLError, ValueError) as error:  # a character that YAML has not
            raise UserError(
                f"{file}: this is no YAML: {clean(' '.join(str(error).split()), 200)}"
            ) from error
        if not isinstance(root, yaml.MappingNode):
            raise UserError(
                f"{file}: a scene is an object of keys and values, such as 'name: PushCup'"
            )
        self.data: dict[str, Any] = self._read(root, ())

    @classmethod
    def read(cls, file: Path) -> tuple[str, Tree]:
        """Read a file; return its text too.

        Raises:
            UserError: it can't be read.
        """
        try:
            text = read_untrusted(file, MAX_BYTES).decode()
        except UnicodeDecodeError as error:
            raise UserError(
                f"{file} is not UTF-8 text (byte {error.start}); save it as UTF-8"
            ) from error
        except UserError as error:
            raise UserError(f"scene file {error}") from error
        return text, cls(file, text)

    def error(self, where: Where, message: str) -> UserError:
        """Build the error of an entry: file, line, way to it, and what is wrong."""
        known = next(
            (where[:n] for n in range(len(where), -1, -1) if where[:n] in self.lines),
            (),
        )
        return UserError(
            f"{self.file}, line {self.lines.get(known, 1)}: {say(where)}{message}"
        )

    def _check_events(self, text: str) -> None:
        """Refuse what would unfold, or make objects, before anything is built."""
        depth = 0
        event: Any
        for event in yaml.parse(text, yaml.SafeLoader):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(
                event, yaml.CollectionEndEvent
            )
            anchor, tag = (
                clean(getattr(event, name, None) or "", 60)
                for name in ("anchor", "tag")
            )
            why = (
                f"at most {MAX_DEPTH} levels of nesting are read; make it flatter"
                if depth > MAX_DEPTH
                else ""
            )
            why = (
                f"anchors (&{anchor} and *{anchor}) are not read; write it out"
                if anchor
                else why
            )
            why = f"tags ({tag}) are not read; leave it out" if tag else why
            if why:
                raise UserError(f"{self.file}, line {event.start_mark.line + 1}: {why}")

    def _read(self, node: Any, where: Where) -> Any:
        self.lines.setdefault(where, node.start_mark.line + 1)
        if isinstance(node, yaml.SequenceNode):
            return [
                self._read(item, (*where, number))
                for number, item in enumerate(node.value)
            ]
        if not isinstance(node, yaml.MappingNode):
            return self._scalar(node, where)
        found: dict[str, Any] = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise self.error(where, "a key must be a word")
            self.lines[*where, key.value] = key.start_mark.line + 1
            if key.value in found:
                raise self.error(
                    (*where, key.value),
                    "this key is written twice; leave one of them out",
                )
            found[key.value] = self._read(value, (*where, key.value))
        return found

    def _scalar(self, node: Any, where: Where) -> Any:
        text: str = node.value
        if node.style is not None:  # in quotes, or folded
            return text
        if text.lower() in _WORDS:
            return _WORDS[text.lower()]
        if not _NUMBER.fullmatch(text):
            return text
        if not math.isfinite(float(text)):
            raise self.error(where, f"the number {clean(text, 60)} is too large")
        return int(text) if re.fullmatch(r"[-+]?[0-9]{1,15}", text) else float(text)


def say(where: Where) -> str:
    """Write the way to an entry, such as ``bodies[2].mass: ``."""
    parts = (
        f"[{step}]" if isinstance(step, int) else f".{clean(step, 60)}"
        for step in where
    )
    return f"{''.join(parts).lstrip('.')}: " if where else ""


def follow(data: Mapping[str, Any], path: str) -> tuple[Any, str | int]:
    """Find a number by a path such as ``bodies.cup.position.x``; return what holds it, and its key there.

    Items of a list are found by name, by number, or in a vector by axis.

    Raises:
        KeyError: there is no such number.
    """
    node: Any = data
    holder: Any = None
    key: str | int = ""
    for step in path.split("."):
        holder = node
        key = step
        if isinstance(node, list):
            names = [
                item.get("name") if isinstance(item, dict) else None for item in node
            ]
            axes = next(
                (
                    words
                    for words in (("x", "y", "z"), ("roll", "pitch", "yaw"))
                    if step in words
                ),
                (),
            )
            key = (
                names.index(step)
                if step in names
                else axes.index(step)
                if step in axes
                else int(step)
            )
        node = holder[key]
    if isinstance(node, bool) or not isinstance(node, int | float):
        raise KeyError(path)
    return holder, key

"""Find the designs document in a model's reply, and save what is sound in a malformed one."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import Any

from core.design import DesignError

EXPECTED = 'expected an object {"strategies": [...]} with at least one strategy'

MAX_REPLY = 5_000_000
"""The most characters of a reply that are read, about ten times the longest answer of a model."""

MAX_SAVED = 1000
"""The most strategies of a malformed reply that are read."""

MAX_REREAD = 20_000_000
"""The most characters behind malformed strategies, which may lie inside each other, that are read again."""

# Not strict, because models write line breaks inside strings. NaN and infinities become strings, which rules refuse.
_DECODER = json.JSONDecoder(strict=False, parse_constant=lambda name: name)

_LIST = re.compile(r'"strategies"\s*:\s*\[')
_NEXT = re.compile(r"[^\s,]")  # what follows separators
_STRATEGY = re.compile(r'\{\s*"(?:parents|strategy_name)"\s*:')  # begins one

# Matches a string (to its end or the reply's), or something that JSON forbids: a comment, or a comma before a closing
# bracket. Possessive quantifiers keep the time linear for every text.
_NOT_JSON = re.compile(
    r'("(?:[^"\\]++|\\.)*+(?:"|\Z))|//[^\n]*|/\*.*?(?:\*/|\Z)|,(?=\s*[]}])', re.DOTALL
)


@dataclass(frozen=True)
class Unread:
    """Replaces a strategy that can't be read, and gives the reason."""

    reason: str


class Malformed(DesignError):
    """A text is not JSON. ``end``: the position at which the decoder found that; the text's end, if it is not known."""

    def __init__(self, reason: str, end: int) -> None:
        super().__init__(reason)
        self.end = end


def decode(text: str, start: int, what: str) -> tuple[Any, int]:
    """Decode the JSON value that begins at ``start``; return it and its end.

    Raises:
        Malformed: says where ``what`` is wrong.
    """
    try:
        return _DECODER.raw_decode(text, start)
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        reason = f"{what} is malformed JSON at {place}: {error.msg}"
        raise Malformed(reason, error.pos) from error
    except RecursionError as error:
        raise Malformed(f"{what} is JSON that is nested too deep", len(text)) from error
    except ValueError as error:
        reason = f"{what} is JSON with a number of too many digits"
        raise Malformed(reason, len(text)) from error


def parse_reply(text: str) -> object:
    """Find and parse the JSON document in a model's reply, with or without text around it.

    It is the first object that has strategies; without one, the first object. ``NaN`` and ``Infinity`` are read as
    strings. If the document is malformed, its strategies are read one by one: comments and extra commas are ignored,
    and an `Unread` replaces each strategy that is cut off or still malformed. A reply is cut off after `MAX_REPLY`
    characters.

    Raises:
        DesignError: there is no object, or it is malformed and has no sound strategy; gives line and column.
    """
    text = text[:MAX_REPLY]
    first: object = None
    failures: list[tuple[int, Malformed]] = []
    start = text.find("{")
    # Each failure counts all lines before it; this many take a second or two.
    tries = 100 + 1_000_000_000 // max(1, len(text))
    for _ in range(tries):
        if start < 0:
            break
        try:
            document, end = decode(text, start, "the reply")
        except Malformed as error:
            # An object that begins before the error would be an inner one.
            end = max(start + 1, error.end)
            failures.append((end - start, error))
        else:
            if "strategies" in document:
                return document
            first = first or document
        start = text.find("{", end)

    if failures:
        saved = _save_strategies(text)
        if saved:
            return {"strategies": saved}
        _, longest = max(failures, key=lambda failure: failure[0])
        raise longest

    if first is None:
        raise DesignError(f"the reply has no JSON object; {EXPECTED}")
    return first


def _save_strategies(text: str) -> list[Any]:
    """Read the strategies of a malformed document one by one; none, unless one of them is sound."""
    opening = _LIST.search(text)
    if opening is None:
        return []

    position = opening.end()
    text = text[:position] + _NOT_JSON.sub(_blank, text[position:])
    strategies: list[Any] = []
    malformed = 0
    reread = 0
    while found := _NEXT.search(text, position):
        position = found.start()
        if found[0] == "]" or len(strategies) == MAX_SAVED or reread > MAX_REREAD:
            break
        try:
            strategy, position = decode(text, position, "the reply")
        except Malformed:
            strategy = _unread(text, position)
            malformed += 1
            reread += len(text) - position
            following = _STRATEGY.search(text, position + 1)
            position = following.start() if following else len(text)

        strategies.append(strategy)
    else:
        if not malformed:
            strategies.append(_unread(text, position))  # the list has no end
            malformed = 1

    return strategies if len(strategies) > malformed else []


def _unread(text: str, position: int) -> Unread:
    """Stand in for the strategy that begins at a position."""
    line = text.count("\n", 0, position) + 1
    return Unread(
        f"the strategy is cut off or malformed (it begins at line {line} of the reply)"
    )


def _blank(match: re.Match[str]) -> str:
    """A string as it is; anything else as blanks and line breaks, so that positions stay the same."""
    return match[1] or re.sub(r"[^\n]", " ", match[0])

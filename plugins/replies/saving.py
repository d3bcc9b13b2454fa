"""Find the designs document in a model's reply, whole or malformed, and save what is sound in it."""

from __future__ import annotations

import re
from itertools import islice
from typing import Any

from core.design import DesignError
from core.designs.replies import EXPECTED, Malformed, Unread, decode
from plugins.replies.envelopes import find_strategies, is_strategy
from plugins.replies.mending import MAX_MENDED, closing, mend_json, read_yaml

MAX_SAVED = 1000
"""The most strategies of a malformed reply that are read."""

MAX_ALL_MENDED = 200_000
"""The most characters of a reply that are mended, which takes time."""

MAX_BLOCKS = 3
"""The most fenced blocks of a reply that are read in other ways."""

MAX_REREAD = 20_000_000
"""The most characters behind malformed strategies, which may lie inside each other, that are read again."""

BLOCK = "```"
"""The key of a block of another language that stands beside a strategy, for the one text that it lacks."""

_FENCE = re.compile(r"```\w*[^\n]{0,100}\n(.*?)(?:\n[ \t]*```|\Z)", re.DOTALL)
_LIST = re.compile(r"strategies\W{0,3}:\s*\[")
_GAP = r"(?:\s++|//[^\n]{0,300}+|/\*.{0,300}?\*/|#[^\n]{0,300}+){0,20}+"
_KEY = rf"""\{{{_GAP}["'“”„«‘]?(%s)["'”“»’]?\s*:"""
_ANY_KEY = re.compile(_KEY % r"\w+", re.DOTALL)
_FIRST = ("parents", "strategy_name", "strategyName")  # begins a strategy
_YAML = re.compile(r"^(?:- )?[ \t]*(?:strateg|tool|action)\w*[ \t]*:", re.MULTILINE)
# Where a list of strategies is cut off before the first key of its next one.
_CUT = re.compile(r"""\s*,\s*(?:\{\s*["'“]?\w*)?\Z""")


def read_reply(text: str) -> dict[str, list[Any]]:
    """Find the strategies in a model's reply, with or without text around them, as a designs document.

    They are those of the last document that has some (`find_strategies`); strategies that stand alone are joined.
    ``NaN`` and ``Infinity`` are read as strings. If the document is malformed, its strategies are mended one by one,
    and an `Unread` replaces each that is cut off or can't be mended.

    Raises:
        DesignError: there is no strategy, or the document is malformed and has no sound one; gives line and column.
    """
    values, longest = _decode_all(text)
    strategies = _last_strategies(values, whole=longest is None)
    if not strategies and longest is not None:
        strategies = _save_strategies(text)
    if not strategies:
        strategies = _last_strategies(values, whole=True)
    if not strategies:
        strategies = _read_otherwise(text)
    if strategies:
        return {"strategies": _with_blocks(strategies, text)}

    if longest is not None:
        raise longest
    for value in values:
        if "strategies" in value:
            return value
    if not values:
        raise DesignError(f"the reply has no JSON object; {EXPECTED}")
    named = ", ".join(str(key)[:40] for key in islice(values[0], 5))
    raise DesignError(f"the reply has no strategies (its JSON has {named}); {EXPECTED}")


def _decode_all(text: str) -> tuple[list[dict[Any, Any]], Malformed | None]:
    """Decode all outermost objects of a text; return them, and the failure that got farthest."""
    values: list[dict[Any, Any]] = []
    longest: Malformed | None = None
    reached = -1
    start = text.find("{")
    # Each failure counts all lines before it; this many take a second or two.
    failures = 100 + 1_000_000_000 // max(1, len(text))
    while start >= 0 and failures > 0:
        try:
            value, end = decode(text, start, "the reply")
            values.append(value)
        except Malformed as error:
            failures -= 1
            # An object that begins before the error would be an inner one.
            end = max(start + 1, error.end)
            if end - start > reached:
                longest = error
                reached = end - start
        start = text.find("{", end)

    return values, longest


def _last_strategies(values: list[dict[Any, Any]], *, whole: bool) -> list[Any]:
    """Return the strategies of the last document that has some; in a ``whole`` reply, else those that stand alone."""
    alone: list[Any] = []
    for value in reversed(values):
        if not is_strategy(value):
            found = find_strategies(value)
            if found:
                return found
        elif whole and len(alone) < MAX_SAVED and value not in alone:
            alone.insert(0, value)

    return alone


def _save_strategies(text: str) -> list[Any]:
    """Read the strategies of a malformed document one by one; none, unless one of them is sound."""
    opening = _LIST.search(text)
    position = 0
    names = list(_FIRST)
    if opening is not None:
        position = opening.end()
        first = _ANY_KEY.search(text, position, position + 1000)
        names += first.groups() if first else ()

    beginning = re.compile(_KEY % "|".join(names), re.DOTALL)
    left = MAX_ALL_MENDED
    reread = 0
    broken_end = 0  # of the last one that can't be mended
    found: list[Any] = []
    while match := beginning.search(text, position):
        if len(found) == MAX_SAVED or reread > MAX_REREAD:
            break
        start = match.start()
        strategy: object
        try:
            strategy, position = decode(text, start, "the reply")
        except Malformed:
            reread += len(text) - start
            strategy, position = _mend_strategy(text, start, left)
            left -= position - start

        is_part = start < broken_end and match[1] not in _FIRST
        if isinstance(strategy, Unread):
            broken_end = max(broken_end, position)
            position = start + 1
        # What else lies in a strategy that can't be mended is a part of it, such as a component.
        if not is_part or is_strategy(strategy):
            found.append(strategy)

    if found and _CUT.match(text, position):
        found.append(_unread(text, position))
    is_any_sound = any(not isinstance(strategy, Unread) for strategy in found)
    return found if is_any_sound else []


def _mend_strategy(text: str, start: int, most: int) -> tuple[object, int]:
    """Mend the strategy of at most ``most`` characters that begins at ``start``; return it, and where it ends."""
    end = closing(text, start, MAX_MENDED)
    if end is None or end - start > most:
        return _unread(text, start), start + 1
    try:
        return mend_json(text[start:end]), end
    except DesignError as error:
        return _unread(text, start, f": {error}"), end


def _unread(text: str, start: int, reason: str = "") -> Unread:
    """Say that the strategy that begins at ``start`` can't be read."""
    line = text.count("\n", 0, start) + 1
    place = f"it begins at line {line} of the reply"
    return Unread(f"the strategy is cut off or malformed ({place}){reason}")


def _read_otherwise(text: str) -> list[Any]:
    """Read what no strategy begins in as usual: JSON with its quotes escaped, malformed JSON of another order, YAML."""
    blocks = [match[1] for match in _FENCE.finditer(text)][:MAX_BLOCKS]
    for piece in (*blocks, text):
        for read in (_read_escaped, _read_mended, _read_yaml):
            try:
                strategies = find_strategies(read(piece))
            except DesignError:
                continue
            if any(isinstance(strategy, dict) for strategy in strategies):
                return strategies
    return []


def _read_escaped(text: str) -> object:
    """Read JSON whose quotes are escaped, as the inside of a string."""
    start = text.find("{")
    inside = text[start : text.rfind("}") + 1]
    return decode(f'"{inside}"', 0, "the reply")[0]


def _read_mended(text: str) -> object:
    """Mend the first object of a text."""
    first = _ANY_KEY.search(text)
    start = first.start() if first else len(text)
    return mend_json(text[start : closing(text, start, MAX_MENDED) or start])


def _read_yaml(text: str) -> object:
    """Read YAML from its first key on."""
    first = _YAML.search(text)
    return read_yaml(text[first.start() if first else len(text) :])


def _with_blocks(strategies: list[Any], text: str) -> list[Any]:
    """Add to each strategy the block of XML beside it, if there are as many blocks as strategies."""
    blocks = [match[1] for match in _FENCE.finditer(text)]
    blocks = [block for block in blocks if block.lstrip().startswith("<")]
    if len(blocks) != len(strategies):
        return strategies
    return [
        {**strategy, BLOCK: block} if isinstance(strategy, dict) else strategy
        for strategy, block in zip(strategies, blocks, strict=True)
    ]

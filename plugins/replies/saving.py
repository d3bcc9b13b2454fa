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
_LIST = re.compile(r"""["'“]?strategies["'”]?\s*:\s*\[""")
_KEY = r"""\{(?:\s|//[^\n]*|/\*.{0,300}?\*/|#[^\n]*)*+["'“]?(?:%s)["'”]?\s*:"""
_ANY_KEY = re.compile(_KEY % r"(\w+)", re.DOTALL)
_FIRST = ("parents", "strategy_name", "strategyName")  # begins a strategy
_YAML = re.compile(r"^(?:- )?[ \t]*(?:strategies|strategy_name)[ \t]*:", re.MULTILINE)


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
    tries = 100 + 1_000_000_000 // max(1, len(text))
    for _ in range(tries):
        if start < 0:
            break
        try:
            value, end = decode(text, start, "the reply")
            values.append(value)
        except Malformed as error:
            # An object that begins before the error would be an inner one.
            end = max(start + 1, error.end)
            if end - start > reached:
                longest = error
                reached = end - start
        start = text.find("{", end)

    return values, longest


def _last_strategies(values: list[dict[Any, Any]], *, whole: bool) -> list[Any]:
    """Return the strategies of the last document that has some; in a ``whole`` reply, else those that stand alone."""
    alone: dict[str, Any] = {}
    for value in reversed(values):
        if not is_strategy(value):
            found = find_strategies(value)
            if found:
                return found
        elif whole:
            name = str(value.get("strategy_name", len(alone)))
            alone.setdefault(name, value)

    return list(reversed(alone.values()))


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
    mended = 0
    reread = 0
    found: list[Any] = []
    while match := beginning.search(text, position):
        if len(found) == MAX_SAVED or reread > MAX_REREAD:
            break
        start = match.start()
        try:
            strategy, position = decode(text, start, "the reply")
        except Malformed:
            reread += len(text) - start
            strategy, position = _mend_strategy(text, start, mended < MAX_ALL_MENDED)
            mended += position - start
        found.append(strategy)

    is_any_sound = any(not isinstance(strategy, Unread) for strategy in found)
    return found if is_any_sound else []


def _mend_strategy(text: str, start: int, is_allowed: bool) -> tuple[object, int]:
    """Mend the strategy that begins at ``start``; return it, and where the next one may begin."""
    reason = ""
    end = closing(text, start, MAX_MENDED)
    if end is not None and is_allowed:
        try:
            return mend_json(text[start:end]), end
        except DesignError as error:
            reason = f": {error}"

    line = text.count("\n", 0, start) + 1
    place = f"it begins at line {line} of the reply"
    return Unread(f"the strategy is cut off or malformed ({place}){reason}"), start + 1


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

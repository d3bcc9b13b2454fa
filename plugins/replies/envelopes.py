"""Find the strategies in what a model answered, wherever they stand: under a key, in a list, alone, in a text."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from core.designs.replies import DECODER
from plugins.replies.mending import ELLIPSIS

MAX_DEPTH = 8
"""How deep strategies may lie."""

PLANS = frozenset({"actionsets", "actions", "actionplans", "plans", "actionset"})
"""Names of a strategy's plans, as `plain_name` gives them."""

_NAMES = PLANS | {
    "strategyname",
    "strategydescription",
    "toolname",
    "tooldescription",
    "actiondescription",
    "gripper",
    "parents",
}


def plain_name(key: object) -> str:
    """Return a key without case and marks, so that ``toolUrdf`` and ``Tool URDF`` are equal to ``tool_urdf``."""
    return re.sub(r"[\W_]+", "", str(key)).lower()


def find_strategies(value: object, depth: int = MAX_DEPTH) -> list[Any]:
    """Return the first list of strategies in a JSON value, at any depth; a single one is a list of one; empty: none.

    A text that holds JSON is looked through, too. An ellipsis among strategies is left out.
    """
    if depth == 0:
        return []
    if isinstance(value, str):
        return find_strategies(_decode(value), depth - 1)

    listed = _listed(value)
    if listed:
        return listed
    for inner in _children(value):
        found = find_strategies(inner, depth - 1)
        if found:
            return found
    return []


def is_strategy(value: object) -> bool:
    """Report whether a value is an object with plans, or with two other fields of a strategy."""
    if not isinstance(value, dict):
        return False
    names = {
        plain_name(key) for key, inner in value.items() if not isinstance(inner, dict)
    }
    return bool(names & PLANS) or len(names & _NAMES) >= 2


def _listed(value: object) -> list[Any]:
    """Return the strategies that a value is, or that it has under the name of a list of them."""
    if isinstance(value, list) and any(map(is_strategy, value)):
        return [item for item in value if item not in (ELLIPSIS, None)]
    if not isinstance(value, dict):
        return []

    for key, inner in value.items():
        is_list = isinstance(inner, list)
        if plain_name(key) == "strategies" and is_list and not _nests(inner):
            return [item for item in inner if item not in (ELLIPSIS, None)]
    if is_strategy(value):
        return [value]
    if value and all(map(is_strategy, value.values())):
        return list(value.values())
    return []


def _nests(value: list[Any]) -> bool:
    """Report whether a list holds only lists."""
    return all(isinstance(inner, list) for inner in value)


def _children(value: object) -> Iterator[object]:
    """Yield what may hold strategies in an object or a list."""
    inside: Any = ()
    if isinstance(value, dict):
        inside = value.values()
    elif isinstance(value, list):
        inside = value
    for inner in inside:
        if isinstance(inner, dict | list | str):
            yield inner


def _decode(text: str) -> object:
    """Decode a text that holds JSON; None: it holds none."""
    text = text.strip()
    if not text.startswith(("{", "[")):
        return None
    try:
        return DECODER.decode(text)
    except (ValueError, RecursionError):
        return None

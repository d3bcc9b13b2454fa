"""Find the designs in what a model answered, wherever they stand: under a key, in a list, alone, in a text."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from plugins.replies.assumptions import assume
from plugins.replies.decoding import DECODER
from plugins.replies.mending import ELLIPSIS

MAX_DEPTH = 8
"""How deep designs may lie."""

PLANS = frozenset(
    {"actionsets", "actions", "actionplans", "plans", "actionset", "actionplan"}
)
"""Names of a design's plans, as `plain_name` gives them."""

NAMES = PLANS | {
    "strategyname",
    "strategydescription",
    "toolname",
    "tooldescription",
    "actiondescription",
    "gripper",
    "parents",
}
"""Names of a design's usual fields."""

LIST_NAMES = frozenset({"strategies", "designs"})
"""Names of the list of designs: the paper's, which is asked for, and ours."""

_ANGLE_UNIT = re.compile(r"^units?|units?$|angle|rotation|orientation|euler|rpy")
_DEGREES = re.compile(r"\W*(?:(?:all )?in )?deg(?:rees?)?\W*")


def plain_name(key: object) -> str:
    """Return a key without case and marks, so that ``toolUrdf`` and ``Tool URDF`` are equal to ``tool_urdf``."""
    return re.sub(r"[\W_]+", "", str(key)).lower()


def find_designs(value: object, depth: int = MAX_DEPTH) -> list[Any]:
    """Return the first list of designs in a JSON value, at any depth; a single one is a list of one; empty: none.

    A text that holds JSON is looked through, too. An ellipsis among designs is left out.
    """
    if depth == 0:
        return []
    if isinstance(value, str):
        return find_designs(_decode(value), depth - 1)

    found = _list_here(value, depth)
    inside: Iterable[Any] = ()
    if isinstance(value, dict):
        inside = value.values()
    elif isinstance(value, list):
        inside = value

    for inner in inside:
        found = found or find_designs(inner, depth - 1)

    return found


def is_design(value: object) -> bool:
    """Report whether a value is an object with plans, or with two other fields of a design."""
    if not isinstance(value, dict):
        return False

    names = {
        plain_name(key)
        for key, inner in value.items()
        if not (isinstance(inner, dict) and "type" in inner)
    }
    return bool(names & PLANS) or len(names & NAMES) >= 2


def says_degrees(key: object, value: object) -> bool:
    """Report whether a field says that angles are in degrees: ``"angle_unit": "degrees"``."""
    if isinstance(value, dict):
        return any(
            says_degrees(f"{key}_{inner}", held) for inner, held in value.items()
        )

    is_unit = _ANGLE_UNIT.search(plain_name(key))
    return is_unit is not None and _DEGREES.fullmatch(str(value).lower()) is not None


def _list_here(value: object, depth: int) -> list[Any]:
    """Return the designs that a value is, or that it has under the name of a list of them."""
    items: Any = ()
    if isinstance(value, list) and any(map(is_design, value)):
        items = value
    if isinstance(value, dict):
        for key, inner in value.items():
            is_named = plain_name(key) in LIST_NAMES and isinstance(inner, list)
            if is_named and not all(isinstance(item, list) for item in inner):
                return _tidy(inner, depth)

        if is_design(value):
            items = [value]
        elif value and all(map(is_design, value.values())):
            items = value.values()
    if items:
        assume("designs outside a list named 'strategies' are read, too")

    return _tidy(items, depth)


def _tidy(items: Any, depth: int) -> list[Any]:
    """Leave out what is no design's place, and take each design out of an object or a text that holds it alone."""
    tidy: list[Any] = []
    for item in items:
        if item in (ELLIPSIS, None):
            continue

        inside = []
        if not is_design(item):
            inside = find_designs(item, depth - 1)

        tidy.append(inside[0] if len(inside) == 1 else item)

    return tidy


def _decode(text: str) -> object:
    """Decode a text that holds JSON, its quotes perhaps escaped; None: it holds none."""
    text = text.strip()
    if not text.startswith(("{", "[")):
        return None

    for spelled in (text, f'"{text}"'):
        try:
            return DECODER.decode(spelled)
        except (ValueError, RecursionError):
            continue

    return None

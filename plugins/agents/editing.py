"""Change a design that was tried before: an agent names it, and the paths that change."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from typing import Any

from core.errors import choices
from core.support.text import clean
from plugins.agents.bench import Refused


def change_design(
    design: Mapping[str, Any], changes: Mapping[str, Any]
) -> dict[str, Any]:
    """Return a design with other values in some places.

    A place is named by keys with dots between them: ``action_sets.0.2.offset.1`` is the second coordinate in the third
    step of the first plan, and ``tool_components.blade.size.0`` the first side of the component ``blade``. A place that
    does not exist yet is one more key of an object.

    Raises:
        Refused: there is no such place; names those that there are.
    """
    changed = copy.deepcopy(dict(design))
    for place, value in changes.items():
        *way, last = place.split(".")
        holder: Any = changed
        for key in way:
            holder = _go(holder, key, place)
        if isinstance(holder, dict):
            holder[last] = value
        else:
            holder[_find_index(holder, last, place)] = value

    return changed


def _go(holder: Any, key: str, place: str) -> Any:
    """Return what stands under a key."""
    if isinstance(holder, dict):
        if key not in holder:
            raise Refused(
                f"change: {clean(place, 100)}: {choices('key', clean(key, 60), holder)}"
            )
        return holder[key]
    return holder[_find_index(holder, key, place)]


def _find_index(holder: Any, key: str, place: str) -> int:
    """Return the number of an item of a list, from 0, by that number or by the name that it has."""
    shown = clean(place, 100)
    if not isinstance(holder, list):
        raise Refused(
            f"change: {shown}: there is nothing below {clean(str(holder), 60)}"
        )

    names = [item.get("name") if isinstance(item, dict) else None for item in holder]
    if key in names:
        return names.index(key)
    if key.isdecimal() and int(key) < len(holder):
        return int(key)
    known = [str(name) for name in names if name]
    named = f" or {', '.join(known)}" if known else ""
    raise Refused(
        f"change: {shown}: {clean(key, 60)!r} is none of 0 to {len(holder) - 1}{named}"
    )


def list_differences(design: Any, other: Any, place: str = "") -> list[str]:
    """List the places in which two designs differ, with both values, a line each."""
    if isinstance(design, dict) and isinstance(other, dict):
        keys = list(dict.fromkeys([*design, *other]))
        pairs = [(key, design.get(key), other.get(key)) for key in keys]
    elif (
        isinstance(design, list)
        and isinstance(other, list)
        and len(design) == len(other)
    ):
        pairs = [
            (str(k), *pair) for k, pair in enumerate(zip(design, other, strict=True))
        ]
    elif design == other:
        return []
    else:
        shown = " -> ".join(clean(json.dumps(value), 80) for value in (design, other))
        return [f"{place}: {shown}"]

    lines = []
    for key, value, changed in pairs:
        lines += list_differences(value, changed, f"{place}.{key}" if place else key)
    return lines

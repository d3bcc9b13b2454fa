"""Keep what is dear to build, while it is used."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import TypeVar

Key = TypeVar("Key")
Value = TypeVar("Value")


def keep(
    kept: OrderedDict[Key, Value], key: Key, most: int, build: Callable[[], Value]
) -> Value:
    """Return what is kept under a key, or build it; at most so many, those that were used last."""
    if key not in kept:
        kept[key] = build()
    kept.move_to_end(key)
    if len(kept) > most:
        kept.popitem(last=False)
    return kept[key]

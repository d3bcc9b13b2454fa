"""Find what a model wrote in the body of a server's answer, or in the lines of a stream of it, as they are saved."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

MAX_DEPTH = 8
"""How deep texts may lie in a body."""

_TEXTS = frozenset(
    {"text", "content", "arguments", "partial_json", "delta", "output_text"}
)
_THOUGHTS = frozenset({"thinking", "reasoning", "thought", "redacted_thinking"})


def join_texts(bodies: Iterable[Any]) -> str:
    """Join the texts of answers, of whatever protocol, in their order, without what the model thought.

    Args:
        bodies: JSON values: one of a whole answer, or each of a piece of it.
    """
    return "".join(text for body in bodies for text in _find_texts(body, MAX_DEPTH))


def _find_texts(value: object, depth: int) -> Iterator[str]:
    """Yield the texts in a JSON value."""
    if depth == 0:
        return

    if isinstance(value, list):
        for item in value:
            yield from _find_texts(item, depth - 1)
        return

    if not isinstance(value, dict) or _is_thought(value):
        return

    for key, inner in value.items():
        if isinstance(inner, str):
            if key in _TEXTS:
                yield inner
        else:
            yield from _find_texts(inner, depth - 1)


def _is_thought(value: dict[Any, Any]) -> bool:
    """Report whether a part of an answer is what the model thought."""
    kind = value.get("type")
    return value.get("thought") is True or (isinstance(kind, str) and kind in _THOUGHTS)

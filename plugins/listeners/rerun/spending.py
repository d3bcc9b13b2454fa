"""The tokens and the cost of the model's replies."""

from __future__ import annotations

from collections.abc import Iterable

from core.interfaces import Reply


def total(replies: Iterable[Reply], name: str) -> float | None:
    """The sum of a figure over the replies that report it; None where none does."""
    known = [value for reply in replies if (value := getattr(reply, name)) is not None]
    return sum(known) if known else None


def spent(replies: Iterable[Reply]) -> str:
    """Tokens and US dollars in words."""
    formats = {"prompt_tokens": "{} in", "completion_tokens": "{} out", "cost_usd": "${:.4f}"}
    sums = ((total(replies, name), text) for name, text in formats.items())
    return ", ".join(text.format(value) for value, text in sums if value is not None)

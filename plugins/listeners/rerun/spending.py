"""The tokens and the cost of the model's replies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

from core.interfaces import Reply

T = TypeVar("T", int, float)


@dataclass(frozen=True)
class Spending:
    """Tokens and US dollars; None where unknown."""

    prompt_tokens: int | None = None
    completion_tokens: int | None = None
    cost_usd: float | None = None

    def __add__(self, other: Spending | Reply) -> Spending:
        return Spending(
            _sum(self.prompt_tokens, other.prompt_tokens),
            _sum(self.completion_tokens, other.completion_tokens),
            _sum(self.cost_usd, other.cost_usd),
        )

    def __str__(self) -> str:
        counts = ((self.prompt_tokens, "in"), (self.completion_tokens, "out"))
        words = [f"{count} {way}" for count, way in counts if count is not None]
        return ", ".join([*words, *([f"${self.cost_usd:.4f}"] if self.cost_usd is not None else [])])


def _sum(a: T | None, b: T | None) -> T | None:
    return b if a is None else a if b is None else a + b

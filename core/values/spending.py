"""Count the cost of calls and compare it with limits. Covered by `tests/plugins/vlms/test_litellm_spending.py`."""

from __future__ import annotations

import threading


class Spending:
    """Cost and tokens of all threads together, and of several models if they share it.

    Args:
        max_cost_usd: None: no limit.
        max_tokens: prompts and answers together; None: no limit.
    """

    def __init__(self, max_cost_usd: float | None, max_tokens: int | None) -> None:
        self.max_cost_usd, self._max_tokens = max_cost_usd, max_tokens
        self.limited = max_cost_usd is not None or max_tokens is not None
        self._cost_usd, self._tokens = 0.0, 0
        self._lock = threading.Lock()

    def add(self, tokens: int, cost_usd: float) -> None:
        with self._lock:
            self._tokens += tokens
            self._cost_usd += cost_usd

    def reached(self) -> str | None:
        """A message that names the limit that is reached; None: none is."""
        with self._lock:
            if self.max_cost_usd is not None and self._cost_usd >= self.max_cost_usd:
                return f"vlm.max_cost_usd={self.max_cost_usd:g} is reached: {self._cost_usd:.4g} US dollars are spent"
            if self._max_tokens is not None and self._tokens >= self._max_tokens:
                return f"vlm.max_tokens_total={self._max_tokens} is reached: {self._tokens} tokens are used"
        return None

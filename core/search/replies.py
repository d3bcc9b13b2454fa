"""Check a model's reply before it is kept: fields of the right type and size, and no keys."""

from __future__ import annotations

import math
from dataclasses import replace

from core.interfaces import Reply
from core.support.secrets import scrub
from core.support.text import clean, kind

MOST = 2**53  # of a count; the store holds less than 2**63
MOST_USD = 1e6  # for a call
_LONGEST = 200, 2000  # characters of a model's name and of an error


def checked(reply: Reply) -> Reply:
    """Return the reply in a form that can be stored and printed.

    A count or a cost that can't be is unknown then; a text that is none is an error. What has a text or a count of
    tokens was paid for, and is an answer.
    """
    text, error = reply.text, reply.error
    if not isinstance(text, str):
        text, error = "", error or f"the text is {kind(text)}"
    return replace(
        reply,
        text=scrub(text.encode("utf-8", "replace").decode("utf-8")),  # JSON can hold half a pair, a UTF-8 file can't
        model=_line(reply.model, _LONGEST[0]),
        error=None if error is None else _line(error, _LONGEST[1]),
        prompt_tokens=_count(reply.prompt_tokens),
        completion_tokens=_count(reply.completion_tokens),
        cost_usd=_cost(reply.cost_usd),
        unanswered=reply.unanswered is True and error is not None and not text and not reply.prompt_tokens,
    )


def _line(text: object, longest: int) -> str:
    return clean(scrub(str(text)), longest)


def _count(value: object) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < MOST else None


def _cost(value: object) -> float | None:
    number = isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value < MOST_USD
    return float(value) if number and math.isfinite(value) else None  # type: ignore[arg-type]

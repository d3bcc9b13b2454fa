"""Define what passes between the program and a model: messages of texts and pictures, replies, and estimates of cost.

Plugins import all of it from `core.interfaces`.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, TypeVar

from core.support.secrets import scrub
from core.support.text import clean, kind

N = TypeVar("N", int, float)


@dataclass(frozen=True)
class Text:
    """A piece of a message."""

    text: str


@dataclass(frozen=True)
class Picture:
    """A piece of a message: the bytes of a PNG file, and the file's name, without suffix, beside the stored request.

    A ``caption`` stands above it.
    """

    png: bytes
    name: str = "scene"
    caption: str = ""


@dataclass(frozen=True)
class Message:
    """One message of a request, its pieces in order."""

    role: Literal["system", "user", "assistant"]
    parts: tuple[Text | Picture, ...]


@dataclass(frozen=True)
class Reply:
    """The answer to a request: the raw text, or ``error``. Token counts and cost are None where they are unknown.

    ``cached_tokens`` of the prompt were kept by the provider from an earlier request, and cost less; ``saved_usd`` is
    what that saved, below 0 where keeping them cost more. ``unanswered``: the call failed for a reason that may pass,
    and nothing was paid. A resumed run asks again. ``cut_by``: the limit of length at which it ended,
    in words; empty: it is whole.
    """

    request_id: str
    text: str
    model: str
    error: str | None = None
    prompt_tokens: int | None = None
    completion_tokens: int | None = None
    cost_usd: float | None = None
    unanswered: bool = False
    cached_tokens: int | None = None
    saved_usd: float | None = None
    cut_by: str = ""


class Bill(NamedTuple):
    """The sum of some replies. Tokens and dollars are None where no reply reports them."""

    replies: int
    errors: int
    prompt_tokens: int | None
    completion_tokens: int | None
    cost_usd: float | None
    cached_tokens: int | None
    saved_usd: float | None

    @classmethod
    def of(cls, replies: Sequence[Reply]) -> Bill:
        """Add up replies."""
        errors = sum(reply.error is not None for reply in replies)
        sums = {
            name: sum_known(getattr(reply, name) for reply in replies)
            for name in cls._fields[2:]
        }
        return cls(len(replies), errors, **sums)


def sum_known(values: Iterable[N | None]) -> N | None:
    """Add up the values that are known; None: none is."""
    known = [value for value in values if value is not None]
    return sum(known[1:], known[0]) if known else None


@dataclass(frozen=True)
class Estimate:
    """An estimate of a request's size and cost, made without calling a model.

    It has the tokens of the messages, the US dollars for each token of prompt and answer (None: unknown), and the
    source of the tokens. ``shared_tokens`` of them begin all requests of a run: a provider that keeps them asks
    ``usd_per_cached_token`` from then on (None: it keeps nothing).
    """

    prompt_tokens: int
    counted_by: str
    usd_per_prompt_token: float | None = None
    usd_per_completion_token: float | None = None
    shared_tokens: int = 0
    usd_per_cached_token: float | None = None


class Spending:
    """Cost and tokens of all threads together, and of several models if they share it.

    Args:
        max_cost_usd: None: no limit.
        max_tokens: prompts and answers together; None: no limit.
    """

    def __init__(self, max_cost_usd: float | None, max_tokens: int | None) -> None:
        self.max_cost_usd = max_cost_usd
        self._max_tokens = max_tokens
        self.limited = max_cost_usd is not None or max_tokens is not None
        self._cost_usd = 0.0
        self._tokens = 0
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


MOST = 2**53  # of a count; the store holds less than 2**63
MOST_USD = 1e6  # for a call
_LONGEST_MODEL = 200  # characters of its name
_LONGEST_ERROR = 2000


def checked(reply: Reply) -> Reply:
    """Return the reply in a form that can be stored and printed.

    A count or a cost that can't be is unknown then; a text that is none is an error. What has a text or a count of
    tokens was paid for, and is an answer.
    """
    text = reply.text
    error = reply.error

    if not isinstance(text, str):
        error = error or f"the text is {kind(text)}"
        text = ""

    # JSON can hold half a pair, a UTF-8 file can't.
    text = scrub(text.encode("utf-8", "replace").decode("utf-8"))
    if error is not None:
        error = clean(scrub(str(error)), _LONGEST_ERROR)
    failed = error is not None and not text and not reply.prompt_tokens
    return replace(
        reply,
        text=text,
        model=clean(scrub(str(reply.model)), _LONGEST_MODEL),
        error=error,
        prompt_tokens=_known(reply.prompt_tokens, int, MOST),
        completion_tokens=_known(reply.completion_tokens, int, MOST),
        cost_usd=_known(reply.cost_usd, int | float, MOST_USD),
        cached_tokens=_known(reply.cached_tokens, int, MOST),
        saved_usd=_known(reply.saved_usd, int | float, MOST_USD, least=-MOST_USD),
        unanswered=reply.unanswered is True and failed,
        cut_by=clean(scrub(str(reply.cut_by)), _LONGEST_MODEL),
    )


def _known(value: Any, wanted: Any, most: float, least: float = 0.0) -> Any:
    """Return a number of a kind, from ``least`` on and below ``most``; None: it is something else."""
    is_number = isinstance(value, wanted) and not isinstance(value, bool)
    if is_number and least <= value < most:
        return value
    return None

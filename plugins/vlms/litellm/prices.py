"""What requests cost, by LiteLLM's price list, and what a provider's cache saves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

from core.interfaces import Estimate, Message, Picture, Request, Text
from plugins.vlms.litellm.loading import load
from plugins.vlms.litellm.wire_messages import explain_schema, render
from plugins.vlms.prompt_files import take_shared

PIXELS_PER_TOKEN = 750  # https://docs.claude.com/en/docs/vision


@dataclass(frozen=True)
class Prices:
    """US dollars for a token: of a prompt, of an answer, of what the provider had kept, and of what it begins to keep.

    The last two are the prompt's price where the list has none.
    """

    prompt: float
    answer: float
    cached: float
    kept: float

    @property
    def caches(self) -> bool:
        """Whether what the provider has kept costs less."""
        return self.cached < self.prompt


def find_prices(litellm: ModuleType, model: str) -> Prices | None:
    """Find a model's prices; None: they are unknown.

    Args:
        litellm: the module.
        model: in LiteLLM's notation.
    """
    try:
        info = litellm.get_model_info(model)
    except Exception:  # a model that is not in the list; the class of the error varies
        return None

    prompt = info.get("input_cost_per_token")
    answer = info.get("output_cost_per_token")
    if not (prompt and answer):
        return None

    cached = info.get("cache_read_input_token_cost")
    kept = info.get("cache_creation_input_token_cost")
    return Prices(float(prompt), float(answer), cached or prompt, kept or prompt)


def count_cached(usage: object) -> tuple[int | None, int]:
    """Return the tokens of a prompt that a provider had kept, and those that it began to keep; None: it doesn't say.

    Args:
        usage: of an answer, in LiteLLM's form.
    """
    details = getattr(usage, "prompt_tokens_details", None)
    cached = _count(getattr(details, "cached_tokens", None))
    kept = _count(getattr(details, "cache_creation_tokens", None))
    if kept is None:
        kept = _count(getattr(usage, "cache_creation_input_tokens", None))

    return cached, kept or 0


def _count(value: Any) -> int | None:
    """Return a count of tokens; None: it is none."""
    is_count = isinstance(value, int) and not isinstance(value, bool) and value >= 0
    return value if is_count else None


def saved(prices: Prices, cached: int, kept: int) -> float:
    """Return the US dollars that a provider's cache saved; below 0, keeping cost more than it saved.

    Args:
        prices: of the model.
        cached: tokens that the provider had kept.
        kept: tokens that it began to keep.
    """
    cheaper = cached * (prices.prompt - prices.cached)
    dearer = kept * (prices.kept - prices.prompt)
    return cheaper - dearer


def estimate(request: Request, model: str) -> Estimate:
    """Count tokens: texts with LiteLLM's counter, pictures by their pixels; prices are from LiteLLM's list.

    Args:
        request: which is not sent.
        model: in LiteLLM's notation.
    """
    litellm = load()
    messages = explain_schema(request)
    shared = take_shared(messages)
    tokens = _count_tokens(litellm, model, messages)
    counter = "litellm.token_counter"
    prices = find_prices(litellm, model)
    if prices is None:
        return Estimate(tokens, counter)

    found = Estimate(tokens, counter, prices.prompt, prices.answer)
    if not (shared and prices.caches):
        return found

    return replace(
        found,
        shared_tokens=_count_tokens(litellm, model, shared),
        usd_per_cached_token=prices.cached,
    )


def _count_tokens(litellm: ModuleType, model: str, messages: Sequence[Message]) -> int:
    """Count the tokens of messages, with their pictures."""
    tokens = 0
    texts = []
    for message in messages:
        pictures = [part for part in message.parts if isinstance(part, Picture)]
        parts = tuple(part for part in message.parts if isinstance(part, Text))
        tokens += sum(map(_picture_tokens, pictures))
        texts.append(replace(message, parts=parts))

    return tokens + int(litellm.token_counter(model=model, messages=render(texts)))


def _picture_tokens(picture: Picture) -> int:
    """Count the tokens of a PNG picture as Claude does, a token for 750 pixels; other providers count otherwise."""
    header = picture.png[:24]
    width = int.from_bytes(header[16:20], "big")
    height = int.from_bytes(header[20:24], "big")
    return math.ceil(width * height / PIXELS_PER_TOKEN)

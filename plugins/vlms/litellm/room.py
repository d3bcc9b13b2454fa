"""Read from a server's words that a prompt doesn't fit into its context, and say what helps."""

from __future__ import annotations

import re

_TOO_LONG = re.compile(
    r"context (length|window|size)|contextwindowexceeded|context_length_exceeded|prompt is too long"
    r"|exceeds the maximum number of tokens|n_ctx|longer than the model",
    re.IGNORECASE,
)
# What was asked for, and what there is room for, in the words of servers: OpenAI and vLLM, llama.cpp (twice),
# Anthropic, Google, SGLang.
_PATTERNS = tuple(
    re.compile(pattern, re.IGNORECASE | re.DOTALL)
    for pattern in (
        r"maximum (?:context|model) length (?:is|of)\D{0,20}(?P<room>\d+).{0,60}?"
        r"(?:requested|request has|resulted in|passed|contains at least|input has)\D{0,20}(?P<asked>\d+)",
        r"requested tokens \((?P<asked>\d+)\) exceed context window of (?P<room>\d+)",
        r"\((?P<asked>\d+) tokens\) exceeds the available context size \((?P<room>\d+)",
        r"(?P<asked>\d+) tokens > (?P<room>\d+) maximum",
        r"token count \((?P<asked>\d+)\) exceeds the maximum number of tokens allowed \((?P<room>\d+)",
        r"\((?P<asked>\d+) tokens\) is longer than the model's context length \((?P<room>\d+)",
        r"(?:prompt|input|request)\D{0,40}(?P<asked>\d+) tokens.{0,80}?(?:context|limit|maximum)\D{0,40}(?P<room>\d+)",
    )
)
_SHORTER = (
    "give the server a larger context, or shorten the prompt: prompt.context=words, prompt.picture=false, "
    "prompt.feedback=paper, a smaller budget.k_top"
)


def is_too_long(words: str) -> bool:
    """Say if a server refuses a prompt for its length."""
    return _TOO_LONG.search(words) is not None


def explain_room(words: str, counted: int, limit: int | None) -> str:
    """Say how long the prompt is, what the server has room for, and what to do.

    Args:
        words: of the server.
        counted: tokens of the prompt, by our own count.
        limit: of an answer, which the room must hold too; None: the server's own.
    """
    asked = f"some {counted}"
    room = "fewer"
    for pattern in _PATTERNS:
        found = pattern.search(words)
        if found is not None:
            asked = found["asked"]
            room = found["room"]
            break

    more = "" if limit is None else f", or lower vlm.max_output_tokens={limit}"
    return f"the request is too long: {asked} tokens, and the server holds {room}; {_SHORTER}{more}"

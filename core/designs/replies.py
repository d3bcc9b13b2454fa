"""Read what a model answered: JSON as it is asked for, and what plugins make of other spellings (`Reader`)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

from core.design import DesignError
from core.plugins import installed

EXPECTED = 'expected an object {"strategies": [...]} with at least one strategy'

MAX_REPLY = 5_000_000
"""The most characters of a reply that are read, about ten times the longest answer of a model."""

Fields = dict[Any, Any]  # of a strategy, which may hold anything

# Not strict, because models write line breaks inside strings. NaN and infinities become strings, which rules refuse.
DECODER = json.JSONDecoder(strict=False, parse_constant=lambda name: name)


@dataclass(frozen=True)
class Unread:
    """Replaces a strategy that can't be read, and gives the reason."""

    reason: str


class Malformed(DesignError):
    """A text is not JSON. ``end``: the position at which the decoder found that; the text's end, if it is not known."""

    def __init__(self, reason: str, end: int) -> None:
        super().__init__(reason)
        self.end = end


class Reader(Protocol):
    """Reads designs in other spellings than the one that is asked for; a plugin offers it as ``designs``."""

    def read_reply(self, text: str) -> object:
        """Find the designs document in a reply. An `Unread` replaces a strategy that can't be read.

        Raises:
            DesignError: there is none, or it has no sound strategy.
        """

    def list_strategies(self, document: object) -> list[Any]:
        """Return the strategies in a document; none: it has none."""

    def read_fields(self, strategy: Fields, wanted: Mapping[str, Any]) -> Fields:
        """Return a strategy's fields by their proper names; ``wanted`` has the schemas of those of its tool.

        Raises:
            DesignError: a name has two meanings.
        """

    def list_plans(
        self, value: object, schema: Mapping[str, Any], *, gripper: bool
    ) -> object:
        """Return a list of plans as their representation reads them; ``schema`` is that of one plan.

        Each is a plan, or a `DesignError` that says what is wrong with it. What is no list stays as it is.
        """


@lru_cache(maxsize=1)
def reader() -> Reader:
    """Make the reader that is installed."""
    found: Reader = installed().factory("reader", "designs")()
    return found


def parse_reply(text: str) -> object:
    """Find the designs document in a model's reply, cut off after `MAX_REPLY` characters; see `Reader.read_reply`."""
    return reader().read_reply(text[:MAX_REPLY])


def decode(text: str, start: int, what: str) -> tuple[Any, int]:
    """Decode the JSON value that begins at ``start``; return it and its end.

    Raises:
        Malformed: says where ``what`` is wrong.
    """
    try:
        return DECODER.raw_decode(text, start)
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        reason = f"{what} is malformed JSON at {place}: {error.msg}"
        raise Malformed(reason, error.pos) from error
    except RecursionError as error:
        raise Malformed(f"{what} is JSON that is nested too deep", len(text)) from error
    except ValueError as error:
        reason = f"{what} is JSON with a number of too many digits"
        raise Malformed(reason, len(text)) from error

"""Read what a model answered: JSON as it is asked for, and what plugins make of other spellings (`Reader`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

from core.plugins import installed

EXPECTED = 'expected an object {"strategies": [...]} with at least one design'

MAX_REPLY = 5_000_000
"""The most characters of a reply that are read, about ten times the longest answer of a model."""

Fields = dict[Any, Any]  # of a design, which may hold anything


@dataclass(frozen=True)
class Unread:
    """Replaces a design that can't be read, and gives the reason."""

    reason: str


class Reader(Protocol):
    """Reads designs in other spellings than the one that is asked for; a plugin offers it as ``designs``."""

    def read_reply(self, text: str) -> object:
        """Find the designs document in a reply. An `Unread` replaces a design that can't be read.

        Raises:
            DesignError: there is none, or it has no sound design.
        """

    def list_designs(self, document: object) -> list[Any]:
        """Return the designs in a document; none: it has none."""

    def read_fields(self, design: Fields, wanted: Mapping[str, Any]) -> Fields:
        """Return a design's fields by their proper names; ``wanted`` has the schemas of those of its tool.

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

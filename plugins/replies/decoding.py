"""Decode JSON that a model wrote, and say where it is malformed."""

from __future__ import annotations

import json
from typing import Any

from core.design import DesignError

# Not strict, because models write line breaks inside strings. NaN and infinities become strings, which rules refuse.
DECODER = json.JSONDecoder(strict=False, parse_constant=lambda name: name)


class Malformed(DesignError):
    """A text is not JSON. ``end``: the position at which the decoder found that; the text's end, if it is not known."""

    def __init__(self, reason: str, end: int) -> None:
        super().__init__(reason)
        self.end = end


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

"""Keep what a design was made of in its document, so that offspring vary that and are built anew."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from core.design import Candidate, Tool
from core.designs.tool_fields import NOTE
from plugins.vlms.offline.making import Made
from plugins.vlms.offline.ways.way import Values

_DIGITS = 6


@dataclass(frozen=True)
class Note:
    """What a design was made of.

    Attributes:
        way: the name of the way of using a tool.
        number: of the alternative of the task that it does (`plugins.vlms.offline.options.Option`).
        values: of all parameters, for each of its plans.
    """

    way: str
    number: int
    values: Sequence[Values]


def write_note(plans: Sequence[Made]) -> dict[str, Any]:
    """Write what a tool with its plans was made of, as JSON has it."""
    option = plans[0].option
    values = [
        {name: round(value, _DIGITS) for name, value in made.values.items()}
        for made in plans
    ]
    return {"way": option.way.name, "number": option.number, "values": values}


def read_note(tool: Tool) -> Note | None:
    """Read what a tool was made of; None: it was made otherwise, or changed since."""
    content, text = tool.written
    if content != tool.content:
        return None

    note = json.loads(text).get(NOTE)
    if not isinstance(note, dict) or {*note} != {"way", "number", "values"}:
        return None
    return Note(**note)


def read_values(candidate: Candidate) -> tuple[Note, Values] | None:
    """Read what a candidate was made of, and the values of its plan; None: see `read_note`."""
    note = read_note(candidate.tool) if candidate.tool else None
    if note is None or candidate.action >= len(note.values):
        return None
    return note, note.values[candidate.action]

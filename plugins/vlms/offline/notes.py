"""Keep what a design was made of in its document, so that offspring vary that and are built anew."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from core.design import Candidate, Tool
from core.designs.tool_fields import NOTE
from plugins.vlms.offline.making import Made
from plugins.vlms.offline.mounting import list_ranges
from plugins.vlms.offline.ways import WAYS
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
    values: Annotated[Sequence[Values], Field(min_length=1)]


_NOTE = TypeAdapter(Note)


def write_note(plans: Sequence[Made]) -> dict[str, Any]:
    """Write what a tool with its plans was made of, as JSON has it."""
    option = plans[0].option
    values = [_round(made.values) for made in plans]
    return {"way": option.way.name, "number": option.number, "values": values}


def _round(values: Values) -> dict[str, float]:
    """Round values as a document has them."""
    return {name: round(value, _DIGITS) for name, value in values.items()}


def read_note(tool: Tool | None) -> Note | None:
    """Read what a tool was made of; None: it was made otherwise, or changed since, or there is none."""
    if tool is None or tool.written[0] != tool.content:
        return None

    _, text = tool.written
    try:
        note = _NOTE.validate_python(json.loads(text).get(NOTE))
    except ValidationError:
        return None
    return note if _is_known(note) else None


def _is_known(note: Note) -> bool:
    """Report whether a way of this version has a note's parameters; those of others may have others."""
    for way in WAYS:
        if way.name == note.way:
            names = {*list_ranges(way)}
            return all({*values} == names for values in note.values)
    return False


def read_values(candidate: Candidate) -> tuple[Note, Values] | None:
    """Read what a candidate was made of, and the values of its plan; None: see `read_note`."""
    note = read_note(candidate.tool)
    if note is None or candidate.action >= len(note.values):
        return None
    return note, note.values[candidate.action]

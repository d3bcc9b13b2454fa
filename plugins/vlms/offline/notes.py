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
from plugins.vlms.offline.recipe import Mount, Recipe, Values
from plugins.vlms.offline.ways import WAYS


@dataclass(frozen=True)
class Note:
    """What a design was made of.

    Attributes:
        way: the name of the way of using a tool.
        number: of the alternative of the task that it does (`plugins.vlms.offline.options.Option`).
        mount: where its head is; None: the head says it itself.
        values: of its way's parameters, for each of its plans.
    """

    way: str
    number: int
    mount: Mount | None
    values: Annotated[Sequence[Values], Field(min_length=1)]


_NOTE = TypeAdapter(Note)


def write_note(plans: Sequence[Made]) -> dict[str, Any]:
    """Write what a tool with its plans was made of, as JSON has it."""
    option = plans[0].option
    mount = plans[0].recipe.mount
    values = [made.recipe.values for made in plans]
    note = Note(option.way.name, option.number, mount, values)
    written: dict[str, Any] = _NOTE.dump_python(note, mode="json")
    return written


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
            is_alike = (note.mount is None) == way.bolted
            return is_alike and all({*v} == {*way.ranges} for v in note.values)
    return False


def read_recipe(candidate: Candidate) -> tuple[Note, Recipe] | None:
    """Read what a candidate was made of, and the recipe of its plan; None: see `read_note`."""
    note = read_note(candidate.tool)
    if note is None or candidate.action >= len(note.values):
        return None
    return note, Recipe(note.values[candidate.action], note.mount)

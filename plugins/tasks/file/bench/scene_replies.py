"""Read what a model answered: a scene file, and what it says beside it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, Field

from core.errors import UserError
from core.support.inputs import STRICT
from plugins.tasks.file.spec import Name, Place
from plugins.tasks.file.tree import MAX_BYTES, Tree

_FENCE = re.compile(r"^```[a-z]*[ \t]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
MOST_BYTES = MAX_BYTES  # of an answer, as of a file
MOST_BLOCKS = 10
LONGEST = 300  # characters of a text that is repeated

Texts = Annotated[tuple[str, ...], Field(max_length=20)]
Pixel = Annotated[float, Field(ge=-5000, le=10_000)]
Side = Pixel | None


class Sighting(BaseModel):
    """Where something is seen: a point of it, or all of it in a box.

    Attributes:
        body: a body or mark of the file, or a place that the user told.
        photo: the photograph's number, from 1.
        pixels: of a point, to the right and down from the photograph's left upper corner; or of a box around all of
            the body its left, upper, right and lower side, None where that is hidden.
        point: of the body: from -1 to 1 in its box along its own axes, so that (0, 0, 1) is the middle of its top.
        part: the number of the one of its parts whose box that is, from 0; None: that of the whole.
    """

    model_config = STRICT

    body: Name
    photo: int
    pixels: tuple[Pixel, Pixel] | tuple[Side, Side, Side, Side]
    point: Place = (0.0, 0.0, 0.0)
    part: Annotated[int, Field(ge=0)] | None = None


class Beside(BaseModel):
    """What a model says beside the file, in a block of its own.

    Attributes:
        sightings: what it saw where.
        unsaid: parts of the sentence that the file can't say.
        questions: to the user, where the sentence has several meanings or none.
    """

    model_config = STRICT

    sightings: Annotated[tuple[Sighting, ...], Field(max_length=500)] = ()
    unsaid: Texts = ()
    questions: Texts = ()


def read_reply(file: Path, reply: str) -> tuple[str, Beside]:
    """Find the blocks of YAML in a reply; return the text of the scene, and what is said beside it.

    Raises:
        UserError: one can't be read, or there is more than a file may hold.
    """
    size = len(reply.encode("utf-8", "replace"))
    if size > MOST_BYTES:
        raise UserError(
            f"the answer has {size:,} bytes; at most {MOST_BYTES:,} are read: leave out what is not asked for"
        )

    blocks = _FENCE.findall(f"{reply}\n") or [reply]
    if len(blocks) > MOST_BLOCKS:
        raise UserError(
            f"the answer has {len(blocks)} blocks; give one with the scene, and one with what is said beside it"
        )

    text = ""
    beside = Beside()
    for block in blocks:
        tree = Tree(file, block)
        if tree.data.keys() - Beside.model_fields:
            text = block
            continue

        beside = tree.check(Beside, tree.data)

    return text, beside

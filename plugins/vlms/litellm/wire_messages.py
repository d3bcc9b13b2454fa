"""Write messages in LiteLLM's form."""

from __future__ import annotations

import base64
import io
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count
from typing import Any

from PIL import Image as Pillow
from PIL import ImageDraw

from core.interfaces import Message, Picture, Request, Text
from plugins.vlms.prompt_files import begins_news

_MARK = {
    "type": "ephemeral"
}  # Anthropic's; LiteLLM passes it on to all that serve its models
_UNSEEN = (
    "(Here is a picture, `{name}`, that you are not shown: this model takes none.)\n\n"
)
_ON_SHEET = (
    "(Picture `{name}` is picture {place} of sheet {sheet}, counted from its top.)\n\n"
)
_MARGIN = 24  # pixels above each picture of a sheet


def explain_schema(request: Request) -> tuple[Message, ...]:
    """Return the messages of a request, with the schema as text at the end, if it has one."""
    if not request.asks_designs:
        return request.messages

    schema = json.dumps(request.schema, ensure_ascii=False, separators=(",", ":"))
    text = Text(f"JSON schema of the answer:\n```json\n{schema}\n```\n")
    *before, last = request.messages
    return (*before, replace(last, parts=(*last.parts, text)))


def without_pictures(messages: Sequence[Message]) -> tuple[Message, ...]:
    """Return messages with a line of text in the place of each picture."""
    return _replace_pictures(
        messages, lambda picture: [Text(_UNSEEN.format(name=picture.name))]
    )


def _replace_pictures(
    messages: Sequence[Message], write: Callable[[Picture], Sequence[Text | Picture]]
) -> tuple[Message, ...]:
    """Return messages with what ``write`` returns in the place of each picture."""
    written = []
    for message in messages:
        parts: list[Text | Picture] = []
        for part in message.parts:
            parts += write(part) if isinstance(part, Picture) else [part]

        written.append(replace(message, parts=tuple(parts)))

    return tuple(written)


def draw_on_sheets(messages: Sequence[Message], most: int) -> tuple[Message, ...]:
    """Return messages with at most so many pictures: neighbours share a sheet, and a line says which is where.

    Args:
        messages: of a request.
        most: pictures that a server takes.
    """
    parts = [part for message in messages for part in message.parts]
    pictures = [part for part in parts if isinstance(part, Picture)]
    if len(pictures) <= most:
        return tuple(messages)

    shared = math.ceil(len(pictures) / most)
    sheets = [
        pictures[first : first + shared] for first in range(0, len(pictures), shared)
    ]
    numbers = count()

    def place(picture: Picture) -> list[Text | Picture]:
        sheet, place = divmod(next(numbers), shared)
        line = _ON_SHEET.format(name=picture.name, sheet=sheet + 1, place=place + 1)
        if place:
            return [Text(line)]
        return [Picture(_draw_sheet(sheets[sheet]), f"sheet_{sheet + 1}"), Text(line)]

    return _replace_pictures(messages, place)


def _draw_sheet(pictures: Sequence[Picture]) -> bytes:
    """Draw pictures below each other on one sheet, each under its number; as a PNG file."""
    images = [
        Pillow.open(io.BytesIO(picture.png)).convert("RGB") for picture in pictures
    ]
    width = max(image.width for image in images)
    height = sum(image.height + _MARGIN for image in images)
    sheet = Pillow.new("RGB", (width, height), "white")
    pen = ImageDraw.Draw(sheet)
    top = 0

    for number, image in enumerate(images, 1):
        pen.text((4, top + 2), f"picture {number}", fill="black", font_size=_MARGIN - 8)
        sheet.paste(image, (0, top + _MARGIN))
        top += image.height + _MARGIN

    buffer = io.BytesIO()
    sheet.save(buffer, "PNG")

    return buffer.getvalue()


def render(messages: Sequence[Message], marks: bool = False) -> list[dict[str, Any]]:
    """Write messages in LiteLLM's form: one text if there is no picture, otherwise parts; pictures are data URLs.

    Args:
        messages: of a request.
        marks: mark the end of what all requests of a run share.
    """
    rendered: list[dict[str, Any]] = []
    for message in messages:
        parts = _write_parts(message)
        if marks and mark_shared(message, parts):
            marks = False  # of one request, the first message that has news
        elif all(part["type"] == "text" for part in parts):
            text = "".join(part["text"] for part in parts)
            rendered.append({"role": message.role, "content": text})
            continue

        rendered.append({"role": message.role, "content": parts})

    return rendered


def mark_shared(message: Message, parts: list[dict[str, Any]]) -> bool:
    """Mark the last part before a message's news; False: it has none, or begins with them.

    Args:
        message: of a request.
        parts: the message's, in LiteLLM's form.
    """
    for index, part in enumerate(message.parts):
        if begins_news(part) and index:
            parts[index - 1]["cache_control"] = _MARK
            return True

    return False


def _write_parts(message: Message) -> list[dict[str, Any]]:
    """Write the parts of a message in LiteLLM's form."""
    parts: list[dict[str, Any]] = []
    for part in message.parts:
        if isinstance(part, Picture):
            url = "data:image/png;base64," + base64.b64encode(part.png).decode()
            parts.append({"type": "image_url", "image_url": {"url": url}})
        else:
            parts.append({"type": "text", "text": part.text})

    return parts

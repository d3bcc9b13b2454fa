"""Write a request into a folder of its own, for a person or a program; tell what is new in it from what all share."""

from __future__ import annotations

import errno
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from core.interfaces import Message, Picture, Request, Text
from core.support.files import write_whole

NOW = "# What is wanted\n"
"""The heading in a prompt above which all requests of a run are alike.

It is read from the text, not a field: a template, which may be a user's own, has no other way to say it, and a mailbox
finds it again in a file of the round before.
"""


def begins_news(part: Text | Picture) -> bool:
    """Say if a part of a message is the first that not all requests of a run share."""
    return isinstance(part, Text) and part.text.lstrip().startswith(NOW)


def take_shared(messages: Sequence[Message]) -> tuple[Message, ...]:
    """Return the beginning of messages that all requests of a run share; it is empty where no heading tells."""
    for number, message in enumerate(messages):
        for index, part in enumerate(message.parts):
            if begins_news(part):
                shared = replace(message, parts=message.parts[:index])
                return (*messages[:number], shared)

    return ()


def write_letter(folder: Path, request: Request, prompt: str) -> None:
    """Write a request's pictures, its schema, and last its prompt, so that the other files are there when it is.

    Args:
        folder: of this request alone; it is made.
        request: whose messages name the pictures.
        prompt: the text of ``prompt.md``.

    Raises:
        OSError: a file can't be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for message in request.messages:
        for part in message.parts:
            if isinstance(part, Picture):
                write_file(folder / f"{part.name}.png", part.png)

    if request.asks_designs:
        lines = json.dumps(request.schema, indent=1, ensure_ascii=False)
        write_file(folder / "schema.json", f"{lines}\n".encode())

    write_file(folder / "prompt.md", prompt.encode())


def write_file(file: Path, data: bytes) -> None:
    """Write a file whole, in a folder that is no link.

    Args:
        file: which is replaced if it is there.
        data: all of it.

    Raises:
        OSError: it can't be written.
    """
    if file.parent.is_symlink():
        raise OSError(errno.ELOOP, f"it is a link to {file.parent.readlink()}")

    write_whole(file, data)

"""Write the plain files beside a run's store: requests, replies, the text of a task."""

from __future__ import annotations

import json
from pathlib import Path

from core.designs.composer import as_markdown
from core.errors import UserError
from core.interfaces import Picture, Request, Task
from core.store.rows import MAX_BYTES
from core.support.files import read_untrusted, write_whole, writing
from core.support.secrets import scrub


def write_text(file: Path, text: str) -> None:
    """Write a text without keys, so that the file is whole or absent."""
    write_whole(file, scrub(text).encode())


def write_request(folder: Path, request: Request) -> None:
    """Write a request to ``requests/``: its text, its schema, and its pictures; the scene's lies in ``folder``."""
    requests = folder / "requests"

    for message in request.messages:
        for part in message.parts:
            if isinstance(part, Picture):
                place = folder if part.name == "scene" else requests
                (place / f"{part.name}.png").write_bytes(part.png)

    write_text(requests / f"{request.id}.md", _as_text(request))

    if request.asks_designs:
        schema = json.dumps(request.schema, indent=2)
        write_text(requests / f"{request.id}.schema.json", schema)


def keep_task(folder: Path, task: Task) -> None:
    """Keep the text of a task that is no program.

    Raises:
        UserError: it is not what it was when the run began.
    """
    if task.language == "python":
        return

    file = folder / f"task.{task.language}"
    text = scrub(task.source())
    with writing(folder):
        if not file.exists():
            write_text(file, text)
        elif read_untrusted(file, MAX_BYTES) != text.encode():
            what = f"the file of the task {task.name} has changed since the run in {folder} began"
            raise UserError(f"{what}; put it back from {file}, or begin a new run")


def _as_text(request: Request) -> str:
    """Write the messages as one Markdown text with links to the pictures."""
    blocks = [
        f"# {message.role}\n\n{as_markdown(message).rstrip()}"
        for message in request.messages
    ]
    return (
        "\n\n".join(blocks).replace("![scene](scene.png)", "![the scene](../scene.png)")
        + "\n"
    )

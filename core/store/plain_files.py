"""Write the plain files beside a run's store: requests and replies."""

from __future__ import annotations

import json
from pathlib import Path

from core.designs.composer import as_markdown
from core.interfaces import Picture, Request
from core.support.files import write_whole
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

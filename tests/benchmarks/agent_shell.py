"""Call a tool of a bench from a shell: ``python -m tests.benchmarks.agent_shell FOLDER TOOL [ARGUMENTS]``.

So whoever has a shell can play at a bench, such as a language model with no other tool. Start the server beside it::

    export VLMGINEER_MCP_TOKEN=secret
    vlmgineer mcp task=SweepCards sim=mujoco prompt.context=pictures budget.n_rollouts=60 folder=runs/a port=8765 &
    python -m tests.benchmarks.agent_shell game describe_task
    python -m tests.benchmarks.agent_shell game look '{"view": "top"}'
    python -m tests.benchmarks.agent_shell game try_design design.json    # ARGUMENTS may be a file
    python -m tests.benchmarks.agent_shell game finish                    # then wait, until the answer is there

Texts are printed, and pictures written to FOLDER. A line of ``FOLDER/calls.jsonl`` says of each call how long it took,
how many characters were given and answered, and how many pictures there were. The server is that at port 8765, or at
``VLMGINEER_MCP_PORT``.
"""

from __future__ import annotations

import asyncio
import base64
import json
import os
import time
from pathlib import Path
from typing import Any

import httpx2
from mcp import Client
from mcp.client.streamable_http import streamable_http_client

from core.errors import UsageError
from core.support.cli import command, say

PATIENCE_S = 120.0


def read_arguments(word: str) -> dict[str, Any]:
    """Read the arguments of a tool, as JSON or from a file of it."""
    file = Path(word)
    text = word if word.lstrip().startswith("{") else file.read_text()
    arguments: dict[str, Any] = json.loads(text)
    return arguments


async def call(tool: str, arguments: dict[str, Any]) -> Any:
    """Call a tool of the server, in a session of its own."""
    port = os.environ.get("VLMGINEER_MCP_PORT", "8765")
    token = os.environ.get("VLMGINEER_MCP_TOKEN", "")
    web = httpx2.AsyncClient(
        headers={"Authorization": f"Bearer {token}"},
        timeout=httpx2.Timeout(PATIENCE_S),
    )
    address = f"http://127.0.0.1:{port}/mcp"
    async with web, Client(streamable_http_client(address, http_client=web)) as client:
        return await client.call_tool(tool, arguments)


def main(words: list[str]) -> int:
    """Call a tool, and show what it answers; the exit status is 1 where it refuses."""
    if len(words) not in (2, 3):
        raise UsageError(str(__doc__))
    folder = Path(words[0])
    folder.mkdir(parents=True, exist_ok=True)
    arguments = read_arguments(words[2]) if len(words) == 3 else {}

    began = time.monotonic()
    answer = asyncio.run(call(words[1], arguments))
    seconds = time.monotonic() - began

    log = folder / "calls.jsonl"
    number = len(log.read_text().splitlines()) + 1 if log.exists() else 1
    texts = [part.text for part in answer.content if part.type == "text"]
    pictures = [part for part in answer.content if part.type == "image"]
    say(*"\n".join(texts).splitlines())
    for place, picture in enumerate(pictures, start=1):
        file = folder / f"{number:03d}_{words[1]}_{place}.png"
        file.write_bytes(base64.b64decode(picture.data))
        say(f"picture: {file}")

    noted = {
        "tool": words[1],
        "seconds": round(seconds, 2),
        "given": len(json.dumps(arguments)),
        "answered": sum(map(len, texts)),
        "pictures": len(pictures),
        "refused": bool(answer.is_error),
    }
    with log.open("a") as lines:
        lines.write(json.dumps(noted) + "\n")
    return int(bool(answer.is_error))


if __name__ == "__main__":
    command(main)

"""Agents for tests: the protocol's own client, with a server in a process of its own."""

import asyncio
import base64
import io
import json
import subprocess
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from mcp import Client, StdioServerParameters
from PIL import Image

ROOT = Path(__file__).parents[3]
SOLUTIONS = ROOT / "tests" / "tasks" / "solutions"
SMALL = (
    "task=BringCube",
    "sim=mujoco",
    "executor.workers=1",
    "listener=[]",
    "film=false",
)

_NOTED = """
import os, sys
with open("pid", "w") as file:
    file.write(str(os.getpid()))
os.execv(sys.executable, [sys.executable, "-m", "core", "mcp", *sys.argv[1:]])
"""


def solution(task="BringCube"):
    return json.loads((SOLUTIONS / f"{task}.json").read_text())


def short():
    """The solution's tool with a plan that ends before the goal."""
    document = solution()
    (strategy,) = document["strategies"]
    strategy["action_sets"] = [strategy["action_sets"][0][:1]]
    return document


def converse(
    talk: Callable[[Client], Awaitable[Any]], folder: Path, *words: str
) -> Any:
    """Start a server with these words, talk with it, and let it end; the file ``pid`` has its number."""
    server = StdioServerParameters(
        command=sys.executable, args=["-c", _NOTED, *words], cwd=str(folder)
    )

    async def meet() -> Any:
        async with Client(server) as client:
            return await talk(client)

    return asyncio.run(meet())


async def ask(client, name, arguments=None, **others):
    """Call a tool, and wait for its answer, on a machine that may be busy."""
    answer = await client.call_tool(name, arguments or {}, **others)
    while " goes on (" in text(answer):
        answer = await client.call_tool("wait")
    return answer


def text(result):
    return "\n".join(part.text for part in result.content if part.type == "text")


def pictures(result):
    parts = [part for part in result.content if part.type == "image"]
    assert all(part.mime_type == "image/png" for part in parts)
    return [Image.open(io.BytesIO(base64.b64decode(part.data))) for part in parts]


def start(folder, *words):
    """Start the server of a session as a program of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "core", "mcp", *words],
        cwd=folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )

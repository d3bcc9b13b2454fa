"""The protocol to its end: by the package's own client, and by clients that do what it forbids."""

import asyncio
import json
import os
import subprocess
import sys
from importlib.metadata import version

import anyio
import pytest
from mcp import Client, StdioServerParameters

from plugins.agents.arguments import read_arguments
from plugins.agents.bench import Refused
from plugins.agents.streams import LONGEST_LINE
from tests.plugins.agents.clients import ROOT, ask, text

BENCH = [sys.executable, "-m", "tests.plugins.agents.quick_bench"]
HELLO = {
    "protocolVersion": "2025-06-18",
    "capabilities": {},
    "clientInfo": {"name": "raw", "version": "1"},
}


def meet(talk, file):
    """Let the package's own client talk with a quick bench."""
    words = [*BENCH[1:], str(file)]
    given = StdioServerParameters(command=BENCH[0], args=words, cwd=str(ROOT))

    async def visit():
        async with Client(given) as client:
            return await talk(client)

    return asyncio.run(visit())


class Raw:
    """A client that writes lines of its own."""

    def __init__(self, file):
        self.notes = file
        self.process = subprocess.Popen(
            [*BENCH, str(file)],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        self.ask(1, "initialize", HELLO)
        self.read()
        self.write(b'{"jsonrpc":"2.0","method":"notifications/initialized"}')

    def ask(self, number, method, params):
        message = {"jsonrpc": "2.0", "id": number, "method": method, "params": params}
        self.write(json.dumps(message).encode())

    def write(self, line):
        self.process.stdin.write(line + b"\n")
        self.process.stdin.flush()

    def read(self):
        return json.loads(self.process.stdout.readline())


@pytest.fixture
def raw(tmp_path):
    client = Raw(tmp_path / "notes")
    yield client
    client.process.kill()
    client.process.wait()
    for stream in (client.process.stdout, client.process.stderr):
        stream.close()


def test_a_call_that_is_cancelled_before_its_turn_is_not_done(tmp_path):
    async def talk(client):
        async with anyio.create_task_group() as group:
            group.start_soon(client.call_tool, "watch", {"candidate": "slow"})
            await anyio.sleep(0.3)
            with anyio.move_on_after(0.3):
                await client.call_tool("try_design", {"designs": "{}"})
            await client.list_tools()  # its answer comes after the cancellation
            (tmp_path / "notes.done").touch()
        return await client.call_tool("best_designs")

    assert text(meet(talk, tmp_path / "notes")) == "best_designs"
    done = (tmp_path / "notes").read_text().splitlines()
    assert done == ["watch slow", "best_designs "]


def test_a_long_call_becomes_a_job_and_meanwhile_nobody_waits(tmp_path):
    file = tmp_path / "notes"

    async def talk(client):
        said = [await client.call_tool("finish") for _ in range(2)]
        busy = await client.call_tool("watch", {"candidate": "x"})
        (tmp_path / "notes.done").touch()
        said += [await ask(client, name) for name in ("wait", "best_designs")]
        return [*said, busy]

    first, again, last, free, busy = meet(talk, file)
    for answer in (first, again, busy):
        assert "finish goes on" in text(answer)
        assert "call wait" in text(answer)
    assert busy.is_error
    assert not first.is_error
    assert text(last) == "what came of it"
    assert text(free) == "best_designs"
    assert file.read_text().splitlines() == ["finish ", "best_designs "]


def test_the_server_says_its_version(raw):
    raw.ask(2, "initialize", HELLO)
    info = raw.read()["result"]["serverInfo"]
    assert info == {"name": "vlmgineer", "version": version("vlmgineer")}


LINES = (
    b'{"jsonrpc":"2.0","id":903,"method":"ping"',
    b"hello",
    b"[" * 100_000,
    b'{"jsonrpc":"2.0","id":904,"method":"ping","params":{"a":"\\ud83d"}}',
    b'{"jsonrpc":"2.0","id":"a","method":3}',
    b'{"jsonrpc":"2.0","id":true,"method":3}',
    b'{"id":"\\u001b[31m' + b"x" * 300 + b'"}',
    b'{"id":905,"params":"' + b"x" * LONGEST_LINE + b'"}',
)


def test_a_line_that_is_no_message_is_answered(raw):
    for line in LINES:
        raw.write(line)
        answer = raw.read()
        assert answer["id"] is None
        assert answer["error"]["code"] == -32700
        assert len(answer["error"]["message"]) < 300
        raw.ask(2, "ping", {})
        assert raw.read() == {"jsonrpc": "2.0", "id": 2, "result": {}}


@pytest.mark.thorough
def test_a_client_that_never_reads_is_not_read_on_and_leaves_when_it_closes(raw):
    stream = raw.process.stdin.fileno()
    os.set_blocking(stream, False)
    lines = b"".join(
        b'{"jsonrpc":"2.0","id":%d,"method":"tools/list"}\n' % number
        for number in range(10, 30_010)
    )
    written = 0
    quiet = 0
    while quiet < 10 and written < len(lines):
        try:
            written += os.write(stream, lines[written : written + 60_000])
            quiet = 0
        except BlockingIOError:
            quiet += 1
            asyncio.run(asyncio.sleep(0.1))
    assert written < len(lines) / 5

    # Its side is closed while the other one stays open, with what it did not read.
    raw.process.stdin.close()
    assert raw.process.wait(120) == 0
    assert raw.process.stderr.read() == b"the agent has left\n"


def test_a_broken_pipe_ends_the_server_quietly(raw):
    raw.process.stdout.close()
    raw.ask(2, "ping", {})
    assert raw.process.wait(120) == 0
    assert raw.process.stderr.read() == b"the agent has left\n"


def test_what_is_being_tried_is_interrupted_when_the_client_leaves(raw):
    raw.ask(2, "tools/call", {"name": "try_design", "arguments": {"designs": {}}})
    while not raw.notes.exists():
        raw.ask(3, "ping", {})
        assert raw.read()["id"] == 3
    raw.process.stdin.close()
    assert raw.process.wait(120) == 0


@pytest.mark.parametrize(
    "name", ["\x1b[31mred\x1b[0m", "a\nb", "\u202eevil", "x" * 900]
)
def test_names_are_cleaned_when_they_are_echoed(name, tmp_path):
    with pytest.raises(Refused) as refused:
        read_arguments(name, {})
    assert str(refused.value).isprintable()
    assert len(str(refused.value)) < 400

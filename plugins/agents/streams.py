"""Carry a client's messages over two streams, a line each: standard input and output.

The package ``mcp`` has a reader of lines too. This one answers a line that is no message, stops reading while its
client takes no answers, and ends when the client closes its side, whatever becomes of the other.
"""

from __future__ import annotations

import select
from contextlib import suppress
from typing import Any, BinaryIO

import anyio
import anyio.to_thread
import mcp_types as types
from anyio.streams.memory import MemoryObjectReceiveStream, MemoryObjectSendStream
from mcp.server import Server
from mcp.shared.message import SessionMessage
from pydantic import ValidationError

from core.support.text import clean

LONGEST_LINE = 8_000_000
"""Bytes of a message; longer ones are no message."""

MOST_OPEN = 64
"""Requests without an answer; until one of them has it, nothing more is read."""

FLUSH_S = 2.0
"""So long a client that has closed its side may take to read what is left for it."""

_MOST_SAID = 200  # characters of what is wrong with a line

Incoming = MemoryObjectSendStream[SessionMessage | Exception]


async def serve_lines(
    server: Server[Any], incoming: BinaryIO, outgoing: BinaryIO
) -> None:
    """Serve the one client at the other end of two streams, until it leaves.

    Args:
        server: answers messages.
        incoming: what the client writes.
        outgoing: what it reads.
    """
    send_in, read = anyio.create_memory_object_stream[SessionMessage | Exception](0)
    write, send_out = anyio.create_memory_object_stream[SessionMessage](0)
    wire = _Wire(incoming, outgoing)

    async with anyio.create_task_group() as group:
        group.start_soon(wire.read, send_in, write.clone(), group.cancel_scope)
        group.start_soon(wire.write, send_out, group.cancel_scope)
        group.start_soon(wire.watch, group.cancel_scope)
        options = server.create_initialization_options()
        await server.run(read, write, options)


class _Wire:
    """Both directions of a client's streams, and the requests that are open between them."""

    def __init__(self, incoming: BinaryIO, outgoing: BinaryIO) -> None:
        self._incoming = incoming
        self._outgoing = outgoing
        self._room = anyio.Semaphore(MOST_OPEN)
        self._open: list[types.RequestId] = []
        self._count = 0

    async def read(
        self,
        messages: Incoming,
        answers: MemoryObjectSendStream[SessionMessage],
        scope: anyio.CancelScope,
    ) -> None:
        """Pass on what the client writes, until it closes its side.

        Args:
            messages: receives them.
            answers: receives what is said of lines that are no message.
            scope: ends what is served; soon after the client has left it ends in any case.
        """
        # What is served may end first, where nobody reads the answers.
        with suppress(anyio.BrokenResourceError, anyio.ClosedResourceError):
            async with messages, answers:
                while line := await self._read_line():
                    self._count += 1
                    if line.isspace():
                        continue
                    message = _parse(line)
                    if isinstance(message, types.JSONRPCError):
                        await answers.send(SessionMessage(message))
                        continue
                    await self._note_request(message)
                    await messages.send(SessionMessage(message))

        scope.deadline = anyio.current_time() + FLUSH_S

    async def _read_line(self) -> bytes:
        """Return the next line, or its beginning where it is too long; empty: the client has left."""
        read_line = self._incoming.readline
        line: bytes = await anyio.to_thread.run_sync(
            read_line, LONGEST_LINE, abandon_on_cancel=True
        )
        rest = line
        while len(rest) == LONGEST_LINE and not rest.endswith(b"\n"):
            rest = await anyio.to_thread.run_sync(
                read_line, LONGEST_LINE, abandon_on_cancel=True
            )
        return line

    async def _note_request(self, message: types.JSONRPCMessage) -> None:
        """Count a request that will be answered, when there is room for it, and leave out one that is cancelled."""
        if isinstance(message, types.JSONRPCRequest):
            await self._room.acquire()
            self._open.append(message.id)
        elif getattr(message, "method", "") == "notifications/cancelled":
            params = getattr(message, "params", None) or {}
            self._close(params.get("requestId"))

    def _close(self, request: object) -> None:
        """Make room for another request in place of one that was answered or cancelled."""
        for opened in self._open:
            if opened == request:
                self._open.remove(opened)
                self._room.release()
                return

    async def watch(self, scope: anyio.CancelScope) -> None:
        """End what is served where the client has left, and nothing is read that would say so."""
        while True:
            count = self._count
            await anyio.sleep(FLUSH_S)
            if count == self._count and _is_closed(self._incoming):
                scope.cancel()

    async def write(
        self,
        answers: MemoryObjectReceiveStream[SessionMessage],
        scope: anyio.CancelScope,
    ) -> None:
        """Write what the client is told, until there is nothing more, or nobody reads it."""
        async with answers:
            async for answer in answers:
                message = answer.message
                text = message.model_dump_json(by_alias=True, exclude_unset=True)
                try:
                    await anyio.to_thread.run_sync(
                        self._write_line, text.encode(), abandon_on_cancel=True
                    )
                except (OSError, ValueError):  # the client has closed the other side
                    break
                if isinstance(message, types.JSONRPCResponse | types.JSONRPCError):
                    self._close(message.id)
        scope.cancel()

    def _write_line(self, line: bytes) -> None:
        self._outgoing.write(line + b"\n")
        self._outgoing.flush()


def _is_closed(stream: BinaryIO) -> bool:
    """Report whether the other side of a pipe is closed, though there may be more to read."""
    asked = select.poll()
    asked.register(stream, 0)
    return any(event & select.POLLHUP for _, event in asked.poll(0))


def _parse(line: bytes) -> types.JSONRPCMessage:
    """Return the message that a line holds; an error where it is none."""
    if len(line) >= LONGEST_LINE:
        return _refuse(f"a message has at most {LONGEST_LINE:,} bytes")
    try:
        return types.jsonrpc_message_adapter.validate_json(line)
    except ValidationError as error:
        wrong = error.errors(include_url=False)[0]["msg"]
        return _refuse(clean(wrong, _MOST_SAID))


def _refuse(wrong: str) -> types.JSONRPCError:
    """Make the answer to a line that is no message."""
    words = f"the line is no message: {wrong}"
    data = types.ErrorData(code=types.PARSE_ERROR, message=words)
    return types.JSONRPCError(jsonrpc="2.0", id=None, error=data)

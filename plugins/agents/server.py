"""Speak the Model Context Protocol: hand an agent's calls to the bench, and its answers back.

The package ``mcp`` reads and writes messages. This module says which tools, documents and prompts there are, reports
the progress of calls, and lets one client in.
"""

from __future__ import annotations

import asyncio
import base64
import io
import secrets
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import suppress
from typing import Any, BinaryIO

import anyio
import anyio.to_thread
import mcp_types as types
from mcp.server import Server, ServerRequestContext
from mcp.server.stdio import stdio_server
from mcp.shared.exceptions import MCPError
from mcp_types.version import HANDSHAKE_PROTOCOL_VERSIONS
from starlette.applications import Starlette
from starlette.responses import JSONResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from core.interfaces import Picture
from core.support.text import clean
from plugins.agents.arguments import DOCUMENTS, KINDS
from plugins.agents.bench import Answer, Bench, Refused

NAME = "vlmgineer"
PATH = "/mcp"
INVENT = "invent"
"""The prompt that starts an agent."""

LOOK_S = 1.0
"""Between two looks whether there is progress to report."""

LONGEST_LINE = 8_000_000
"""Bytes of a message; longer ones are no message."""

SILENT_S = 120.0
"""So long a client may be silent over HTTP before another one may take its place."""

_INSTRUCTIONS = (
    "A bench on which you invent a tool for a robot arm: call describe_task first, then look, check_design and "
    "try_design; watch what fails; finish at the end."
)
_START = (
    "Invent a tool and a motion for the task of the vlmgineer bench. Call describe_task and read all of it. Look at "
    "the scene from several views. Then design, check, try and watch, one idea after another, until the budget is "
    "spent or a design holds in all layouts. Call finish at the end, and say what it answered."
)

Context = ServerRequestContext[Any, Any]


def build_server(bench: Bench) -> Server[Any]:
    """Make the server of a bench."""
    handlers = _Handlers(bench)
    return Server(
        NAME,
        instructions=_INSTRUCTIONS,
        on_list_tools=handlers.list_tools,
        on_call_tool=handlers.call_tool,
        on_list_resources=handlers.list_resources,
        on_read_resource=handlers.read_resource,
        on_list_prompts=handlers.list_prompts,
        on_get_prompt=handlers.get_prompt,
    )


class _Handlers:
    """What the server answers.

    Args:
        bench: does the work.
    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    async def list_tools(
        self, context: Context, page: types.PaginatedRequestParams | None
    ) -> types.ListToolsResult:
        tools = []
        for name, kind in KINDS.items():
            hints = types.ToolAnnotations(
                read_only_hint=kind.reads_only,
                destructive_hint=False,
                open_world_hint=False,
            )
            tools.append(
                types.Tool(
                    name=name,
                    description=kind.description,
                    input_schema=kind.arguments.model_json_schema(),
                    annotations=hints,
                )
            )
        return types.ListToolsResult(tools=tools)

    async def call_tool(
        self, context: Context, call: types.CallToolRequestParams
    ) -> types.CallToolResult:
        """Do a call. What is wrong with it is an answer, which the agent reads and acts on."""
        try:
            answer = await self._ask(context, call.name, call.arguments or {})
        except Refused as refused:
            text = types.TextContent(text=str(refused))
            return types.CallToolResult(content=[text], is_error=True)
        return types.CallToolResult(content=[_content(part) for part in answer])

    async def _ask(
        self, context: Context, name: str, arguments: Mapping[str, Any]
    ) -> Answer:
        """Put a call in line, and wait for its answer; report meanwhile what the run is at.

        A call that is cancelled before its turn is not done at all.
        """
        self._note_client(context)
        answer = asyncio.wrap_future(self._bench.submit(name, arguments))
        began = time.monotonic()
        while True:
            done, _ = await asyncio.wait([answer], timeout=LOOK_S)
            if done:
                return answer.result()
            seconds = time.monotonic() - began
            doing = f"{self._bench.doing}; {seconds:.0f} s"
            await context.session.report_progress(seconds, None, doing)

    def _note_client(self, context: Context) -> None:
        """Note the name of the program that calls, for the record."""
        params = context.session.client_params
        if params is not None:
            client = params.client_info
            self._bench.agent = clean(f"{client.name} {client.version}", 100)

    async def list_resources(
        self, context: Context, page: types.PaginatedRequestParams | None
    ) -> types.ListResourcesResult:
        resources = [
            types.Resource(
                uri=address,
                name=address.rpartition("/")[2],
                description=description,
                mime_type="text/markdown",
            )
            for address, description in DOCUMENTS.items()
        ]
        return types.ListResourcesResult(resources=resources)

    async def read_resource(
        self, context: Context, asked: types.ReadResourceRequestParams
    ) -> types.ReadResourceResult:
        uri = str(asked.uri)
        if uri not in DOCUMENTS:
            listed = ", ".join(DOCUMENTS)
            wrong = f"no resource {clean(uri, 100)!r}; there are: {listed}"
            raise MCPError(types.INVALID_PARAMS, wrong)
        try:
            answer = await self._ask(context, uri, {})
        except Refused as refused:
            raise MCPError(types.INTERNAL_ERROR, str(refused)) from refused

        texts = [part.text for part in answer if not isinstance(part, Picture)]
        text = types.TextResourceContents(
            uri=uri, text="\n".join(texts), mime_type="text/markdown"
        )
        return types.ReadResourceResult(contents=[text])

    async def list_prompts(
        self, context: Context, page: types.PaginatedRequestParams | None
    ) -> types.ListPromptsResult:
        prompt = types.Prompt(name=INVENT, description="Begin to invent a tool.")
        return types.ListPromptsResult(prompts=[prompt])

    async def get_prompt(
        self, context: Context, asked: types.GetPromptRequestParams
    ) -> types.GetPromptResult:
        if asked.name != INVENT:
            wrong = f"no prompt {clean(asked.name, 60)!r}; there is: {INVENT}"
            raise MCPError(types.INVALID_PARAMS, wrong)
        message = types.PromptMessage(
            role="user", content=types.TextContent(text=_START)
        )
        return types.GetPromptResult(messages=[message])


def _content(part: Any) -> types.TextContent | types.ImageContent:
    if isinstance(part, Picture):
        data = base64.b64encode(part.png).decode("ascii")
        return types.ImageContent(data=data, mime_type="image/png")
    return types.TextContent(text=part.text)


# --- standard input and output --------------------------------------------------------------------------------------


class Lines:
    """The lines of a client, as the protocol's package reads them; one that is too long is no message.

    Args:
        stream: that the client writes to.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream

    def __aiter__(self) -> AsyncIterator[str]:
        return self._read()

    async def _read(self) -> AsyncIterator[str]:
        while True:
            line = await anyio.to_thread.run_sync(
                self._stream.readline, LONGEST_LINE, abandon_on_cancel=True
            )
            if not line:
                return
            if len(line) == LONGEST_LINE and not line.endswith(b"\n"):
                await anyio.to_thread.run_sync(self._skip, abandon_on_cancel=True)
                line = b"too long"
            yield line.decode("utf-8", "replace")

    def _skip(self) -> None:
        """Read on to the end of a line."""
        rest = self._stream.readline(LONGEST_LINE)
        while rest and not rest.endswith(b"\n"):
            rest = self._stream.readline(LONGEST_LINE)


async def serve_streams(bench: Bench, incoming: BinaryIO, outgoing: BinaryIO) -> None:
    """Serve the one client at the other end of two streams, until it leaves."""
    server = build_server(bench)
    writer = anyio.wrap_file(io.TextIOWrapper(outgoing, encoding="utf-8"))
    lines: Any = Lines(incoming)  # of a file, the package only iterates over lines
    try:
        async with stdio_server(lines, writer) as (read, write):
            options = server.create_initialization_options()
            await server.run(read, write, options)
    finally:
        bench.leave()


# --- HTTP -------------------------------------------------------------------------------------------------------------


def build_app(bench: Bench, token: str) -> Starlette:
    """Make the HTTP application of a bench, for one client at a time, who knows the token."""
    app = build_server(bench).streamable_http_app(
        streamable_http_path=PATH,
        max_sessions=1,
        session_idle_timeout=SILENT_S,
        max_request_body_size=LONGEST_LINE,
    )
    app.add_middleware(_Door, token=token)
    return app


class _Door:
    """Lets in who knows the token, and speaks a version of the protocol with sessions: they tell clients apart.

    Args:
        app: behind the door.
        token: which a request has in its header ``Authorization``.
    """

    def __init__(self, app: ASGIApp, token: str) -> None:
        self._app = app
        self._token = f"Bearer {token}".encode()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            refused = self._refuse(dict(scope["headers"]))
            if refused is not None:
                await refused(scope, receive, send)
                return
        await self._app(scope, receive, send)

    def _refuse(self, headers: Mapping[bytes, bytes]) -> Response | None:
        given = headers.get(b"authorization", b"")
        if not secrets.compare_digest(given, self._token):
            return JSONResponse(
                {"error": "give the server's token: Authorization: Bearer TOKEN"},
                401,
                {"WWW-Authenticate": "Bearer"},
            )

        version = headers.get(b"mcp-protocol-version", b"").decode("latin-1")
        if version and version not in HANDSHAKE_PROTOCOL_VERSIONS:
            supported = list(HANDSHAKE_PROTOCOL_VERSIONS)
            error = {
                "code": types.UNSUPPORTED_PROTOCOL_VERSION,
                "message": "this server keeps one session with one client",
                "data": {"supported": supported, "requested": clean(version, 40)},
            }
            return JSONResponse({"jsonrpc": "2.0", "id": None, "error": error}, 400)
        return None


def run_until_end(serve: Callable[[], Awaitable[None]]) -> None:
    """Run a server in this thread; a client that goes away while it is answered ends it quietly."""
    with suppress(BrokenPipeError, anyio.BrokenResourceError):
        anyio.run(serve)

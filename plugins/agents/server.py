"""Speak the Model Context Protocol: hand an agent's calls to the bench, and its answers back.

The package ``mcp`` reads and writes messages. This module says which tools, documents and prompts there are, reports
the progress of calls, and lets one client in.
"""

from __future__ import annotations

import asyncio
import base64
import importlib.metadata
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO

import anyio
import mcp_types as types
from mcp.server import Server, ServerRequestContext
from mcp.shared.exceptions import MCPError

from core.interfaces import Picture, Text
from core.support.text import clean
from plugins.agents.arguments import DOCUMENTS, FINISH, KINDS, WAIT
from plugins.agents.bench import Answer, Bench, Refused
from plugins.agents.streams import serve_lines

NAME = "vlmgineer"
INVENT = "invent"
"""The prompt that starts an agent."""

LOOK_S = 1.0
"""Between two looks whether there is progress to report."""

PATIENCE_S = 40.0
"""So long a call waits for its answer: many clients give up after 60 s."""

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
        version=importlib.metadata.version(NAME),
        instructions=_INSTRUCTIONS,
        on_list_tools=handlers.list_tools,
        on_call_tool=handlers.call_tool,
        on_list_resources=handlers.list_resources,
        on_read_resource=handlers.read_resource,
        on_list_prompts=handlers.list_prompts,
        on_get_prompt=handlers.get_prompt,
    )


@dataclass(frozen=True, eq=False)
class _Job:
    """A call that was answered before it was done, and its answer."""

    name: str
    answer: asyncio.Future[Answer]


class _Handlers:
    """What the server answers.

    Args:
        bench: does the work.
    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._job: _Job | None = None

    async def list_tools(
        self, context: Context, page: types.PaginatedRequestParams | None
    ) -> types.ListToolsResult:
        self._note_client(context)
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
        """Put a call in line, and wait for its answer.

        One that takes long becomes a job, which goes on after a first answer; `wait` gives the last one. A call that is
        cancelled before its turn is not done.

        Raises:
            Refused: it can't be done, or something else is being done.
        """
        self._note_client(context)
        job = self._job
        if job is not None and (name == WAIT or name == job.name == FINISH):
            return await self._follow(context, job, PATIENCE_S if name == WAIT else 0)
        if job is not None and not job.answer.done():
            raise Refused(self._say_how_far(job.name))

        answer = asyncio.wrap_future(self._bench.submit(name, arguments))
        patience_s = LOOK_S if name == FINISH else PATIENCE_S
        if name in DOCUMENTS:  # no tool gives them later
            patience_s = math.inf
        try:
            await self._watch(context, answer, patience_s)
            if not answer.done():
                self._job = _Job(name, answer)
        finally:
            if self._job is None or self._job.answer is not answer:
                answer.cancel()  # of one that has its answer it changes nothing

        if self._job is not None and self._job.answer is answer:
            return [Text(self._say_how_far(name))]
        return answer.result()

    async def _follow(self, context: Context, job: _Job, patience_s: float) -> Answer:
        """Give the answer of a job, if it comes soon, or say how far it is."""
        await self._watch(context, job.answer, patience_s)
        if not job.answer.done():
            return [Text(self._say_how_far(job.name))]
        self._job = None
        return job.answer.result()

    async def _watch(
        self, context: Context, answer: asyncio.Future[Answer], patience_s: float
    ) -> None:
        """Wait for an answer, and report meanwhile what the run is at."""
        began = time.monotonic()
        seconds = 0.0
        while seconds < patience_s:
            done, _ = await asyncio.wait([answer], timeout=LOOK_S)
            if done:
                return
            seconds = time.monotonic() - began
            doing = f"{self._bench.describe()}; {seconds:.0f} s"
            await context.session.report_progress(seconds, None, doing)

    def _say_how_far(self, name: str) -> str:
        """Say how far a job is."""
        return f"{name} goes on ({self._bench.describe()}); call {WAIT} for what comes of it"

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


def serve_streams(bench: Bench, incoming: BinaryIO, outgoing: BinaryIO) -> None:
    """Serve the client at the other end of two streams, until it leaves, and say then that it has left."""
    try:
        anyio.run(serve_lines, build_server(bench), incoming, outgoing)
    finally:
        bench.leave()

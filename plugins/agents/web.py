"""Serve a bench over HTTP, for one client at a time, who knows the token."""

from __future__ import annotations

import secrets
import time
from collections.abc import Mapping

import mcp_types as types
from mcp_types.version import HANDSHAKE_PROTOCOL_VERSIONS
from starlette.applications import Starlette
from starlette.responses import JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from core.support.text import clean
from plugins.agents.bench import Bench
from plugins.agents.server import build_server
from plugins.agents.streams import LONGEST_LINE

PATH = "/mcp"

SILENT_S = 120.0
"""So long a client may be silent before another one may take its place."""

_SESSION = b"mcp-session-id"
_FULL = 503  # what the package answers where the one session is taken


def build_app(bench: Bench, token: str) -> Starlette:
    """Make the HTTP application of a bench."""
    app = build_server(bench).streamable_http_app(
        streamable_http_path=PATH,
        max_sessions=1,
        session_idle_timeout=SILENT_S,
        max_request_body_size=LONGEST_LINE,
    )
    app.add_middleware(_Door, token=token, bench=bench)
    return app


class _Door:
    """Lets in who knows the token, and speaks a version of the protocol with sessions: they tell clients apart.

    A second client is told who holds the session.

    Args:
        app: behind the door.
        token: which a request has in its header ``Authorization``.
        bench: knows the client's name.
    """

    def __init__(self, app: ASGIApp, token: str, bench: Bench) -> None:
        self._app = app
        self._token = f"Bearer {token}".encode()
        self._bench = bench
        self._opened = time.monotonic()
        self._heard = time.monotonic()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        headers = dict(scope["headers"])
        refused = self._refuse(headers)
        if refused is not None:
            await refused(scope, receive, send)
        elif _SESSION in headers:
            self._heard = time.monotonic()
            await self._app(scope, receive, send)
            self._heard = time.monotonic()
        else:
            await self._open(scope, receive, send)

    async def _open(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a client open a session, or tell it who holds the one that there is."""
        is_full = False

        async def answer(message: Message) -> None:
            nonlocal is_full
            if message["type"] == "http.response.start":
                is_full = message["status"] == _FULL
                if _SESSION in dict(message["headers"]):
                    self._bench.agent = ""
                    self._opened = time.monotonic()
                    self._heard = self._opened
            if not is_full:
                await send(message)

        await self._app(scope, receive, answer)
        if is_full:
            refused = _fail(_FULL, types.INTERNAL_ERROR, self._say_who())
            await refused(scope, receive, send)

    def _say_who(self) -> str:
        """Say who holds the session, and when it is free."""
        now = time.monotonic()
        name = self._bench.agent or "another client"
        return (
            f"{name} has held the one session of this server for {now - self._opened:.0f} s, and was last heard "
            f"{now - self._heard:.0f} s ago; it is free when that client leaves, or is silent for {SILENT_S:.0f} s"
        )

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
            data = {
                "supported": list(HANDSHAKE_PROTOCOL_VERSIONS),
                "requested": clean(version, 40),
            }
            words = "this server keeps one session with one client"
            return _fail(400, types.UNSUPPORTED_PROTOCOL_VERSION, words, data)
        return None


def _fail(
    status: int, code: int, words: str, data: Mapping[str, object] | None = None
) -> Response:
    """Make an answer that says what is wrong, as the protocol has it."""
    error = types.ErrorData(code=code, message=words, data=data)
    message = types.JSONRPCError(jsonrpc="2.0", id=None, error=error)
    return JSONResponse(message.model_dump(exclude_none=True) | {"id": None}, status)

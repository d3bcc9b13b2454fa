"""Servers on the loopback interface that speak the protocols of OpenAI, Google, Anthropic and Ollama, and can fail in
many ways.
"""

from __future__ import annotations

import base64
import json
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, cast

from core.interfaces import Brief, Message, Picture, Request, Text

LONGEST_BODY = 10_000_000
PATHS = {
    ":generateContent": "google",
    ":streamGenerateContent": "google",
    "/v1/messages": "anthropic",
    "/api/chat": "ollama",
    "/chat/completions": "openai",
}

PNG = b"\x89PNG\r\n" + bytes(range(256))
SCHEMA = {
    "type": "object",
    "properties": {
        "numbers": {
            "type": "array",
            "items": {"type": "number"},
            "minItems": 2,
            "maxItems": 2,
        }
    },
    "required": ["numbers"],
    "additionalProperties": False,
}


def request(agent: int, temperature: float = 1.25) -> Request:
    """An agent's request. The text names the agent, and its seed is 100 more."""
    brief: Any = Brief(
        cast(Any, None),
        0,
        cast(Any, None),
        False,
        1,
        1,
        0,
        agent,
        100 + agent,
        actions=cast(Any, None),
    )
    user = Message(
        "user", (Text(f"I am agent {agent}.\n\n"), Text("Design."), Picture(PNG))
    )
    return Request(
        f"g0-a{agent}",
        brief,
        (Message("system", (Text("Be brief."),)), user),
        SCHEMA,
        temperature,
    )


@dataclass(frozen=True)
class Say:
    """Answer with a text in the protocol's form; ``finish`` in the protocol's words, None: an ordinary end."""

    text: str = "{}"
    finish: str | None = None
    after_s: float = 0.0


@dataclass(frozen=True)
class Send:
    """Answer with exactly this body; ``repeat``: so many times one after another, until the client hangs up.

    ``missing``: so many bytes are announced, and never sent: the connection breaks off.
    """

    body: str | bytes
    status: int = 200
    headers: tuple[tuple[str, str], ...] = ()
    type: str = "application/json"
    repeat: int = 1
    missing: int = 0


@dataclass(frozen=True)
class Reset:
    """Break the connection without an answer."""


@dataclass(frozen=True)
class Stall:
    """Send nothing, or a blank ten times a second, until the server is closed."""

    drip: bool = False


Act = Say | Send | Reset | Stall


@dataclass(frozen=True)
class Call:
    """A received call: path, headers in lower case, document; ``texts`` and ``pictures`` of the user's message, the
    system message, and the time of arrival.
    """

    path: str
    headers: dict[str, str]
    body: dict[str, Any]
    protocol: str
    system: str
    texts: list[str]
    pictures: list[bytes]
    at: float


@dataclass
class Server:
    """``most_at_once`` is the largest number of calls that waited for an answer at the same time.

    Asked as Ollama's server is, it says that its model was made for ``context`` tokens, if it was.
    """

    url: str
    calls: list[Call] = field(default_factory=list)
    waiting: int = 0
    most_at_once: int = 0
    closing: threading.Event = field(default_factory=threading.Event)
    context: int | None = None


@contextmanager
def serving(
    script: Callable[[Call], Act], *, any_path: bool = False, at_once: int = 1
) -> Iterator[Server]:
    """A server that answers each call as ``script`` returns; it lives as long as the context.

    With ``any_path`` it takes calls of other protocols too, without reading what they say. It answers nothing before
    ``at_once`` calls have waited at the same time, for at most a minute.
    """
    server = Server("")
    lock = threading.Lock()
    together = threading.Condition(lock)

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            if self.path.endswith("/api/show"):
                _show(self, server.context)
                return

            call = _taken(self) if any_path else _read(self)
            with lock:
                server.calls.append(call)
                server.waiting += 1
                server.most_at_once = max(server.most_at_once, server.waiting)
                act = script(call)
                together.notify_all()
                together.wait_for(
                    lambda: server.most_at_once >= at_once or server.closing.is_set(),
                    timeout=60,
                )
            try:
                _act(self, act, call, server.closing)
            finally:
                with lock:
                    server.waiting -= 1

        def log_message(self, format: str, *args: Any) -> None: ...

    class Quiet(ThreadingHTTPServer):
        daemon_threads = True
        request_queue_size = 64

        def handle_error(
            self, request: Any, client_address: Any
        ) -> None: ...  # a client that hung up

    with Quiet(("127.0.0.1", 0), Handler) as http:
        server.url = f"http://127.0.0.1:{http.server_port}"
        thread = threading.Thread(
            target=http.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True
        )
        thread.start()
        try:
            yield server
        finally:
            server.closing.set()
            http.shutdown()
            thread.join()


def _show(handler: BaseHTTPRequestHandler, context: int | None) -> None:
    """Answer as Ollama does what a model is."""
    handler.rfile.read(int(handler.headers["Content-Length"]))
    facts = {} if context is None else {"m.context_length": context}
    shown = {"capabilities": ["completion", "vision"], "model_info": facts}
    body = json.dumps({**shown, "template": "", "details": {}}).encode()
    handler.send_response(200)
    handler.send_header("Content-Type", "application/json")
    handler.send_header("Content-Length", str(len(body)))
    handler.end_headers()
    handler.wfile.write(body)


def _taken(handler: BaseHTTPRequestHandler) -> Call:
    handler.rfile.read(int(handler.headers["Content-Length"]))
    headers = {name.lower(): value for name, value in handler.headers.items()}
    return Call(handler.path, headers, {}, "", "", [], [], time.monotonic())


def _read(handler: BaseHTTPRequestHandler) -> Call:
    length = int(handler.headers["Content-Length"])
    assert length <= LONGEST_BODY
    body = json.loads(handler.rfile.read(length))
    headers = {name.lower(): value for name, value in handler.headers.items()}
    protocol = next(
        name
        for end, name in PATHS.items()
        if handler.path.partition("?")[0].endswith(end)
    )
    messages = body.get("contents") or body["messages"]
    user = [message for message in messages if message["role"] == "user"]
    system = [message for message in messages if message["role"] == "system"]
    system += [{"text": body.get("system")}, body.get("system_instruction")]
    said = "".join(_strings(system, "text", "content"))
    data = [
        text.removeprefix("data:image/png;base64,")
        for text in _strings(user, "data", "url", "images")
    ]
    pictures = [base64.b64decode(text, validate=True) for text in data]
    texts = list(_strings(user, "text", "content"))
    return Call(
        handler.path, headers, body, protocol, said, texts, pictures, time.monotonic()
    )


def _strings(node: Any, *names: str) -> Iterator[str]:
    """The texts of a document that stand under one of the names, alone or in a list."""
    if isinstance(node, dict):
        for name, value in node.items():
            texts = value if isinstance(value, list) else [value]
            yield from (
                text for text in texts if name in names and isinstance(text, str)
            )
            yield from _strings(value, *names)
    elif isinstance(node, list):
        for item in node:
            yield from _strings(item, *names)


def _act(
    handler: BaseHTTPRequestHandler, act: Act, call: Call, closing: threading.Event
) -> None:
    if isinstance(act, Reset):
        # No lingering: closing sends a reset.
        handler.connection.setsockopt(
            socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0)
        )
        handler.connection.close()
        handler.close_connection = True
        return
    if isinstance(act, Stall):
        if act.drip:
            handler.send_response(200)
            handler.send_header("Content-Type", "application/json")
            handler.send_header("Content-Length", "1000000")
            handler.end_headers()
        while not closing.wait(0.1):
            if act.drip:
                handler.wfile.write(b" ")
        handler.close_connection = True
        return
    if isinstance(act, Say):
        closing.wait(act.after_s)
        act = Send(json.dumps(document(act, call)))
    body = act.body.encode() if isinstance(act.body, str) else act.body
    handler.send_response(act.status)
    handler.send_header("Content-Type", act.type)
    length = len(body) * act.repeat + act.missing
    handler.send_header("Content-Length", str(length))
    for name, value in act.headers:
        handler.send_header(name, value)
    handler.end_headers()
    for _ in range(act.repeat):
        handler.wfile.write(body)
    if act.missing:
        handler.close_connection = True


def document(say: Say, call: Call) -> dict[str, Any]:
    """An answer of 7 tokens to a prompt of 1000."""
    if call.protocol == "google":
        candidate = {
            "content": {"role": "model", "parts": [{"text": say.text}]},
            "finishReason": say.finish or "STOP",
        }
        usage = {
            "promptTokenCount": 1000,
            "candidatesTokenCount": 7,
            "totalTokenCount": 1007,
        }
        return {
            "candidates": [candidate],
            "usageMetadata": usage,
            "modelVersion": "gemini-2.5-pro",
        }
    message = {"role": "assistant", "content": say.text}
    if call.protocol == "ollama":
        counts = {"prompt_eval_count": 1000, "eval_count": 7}
        return {
            "model": "m",
            "message": message,
            "done": True,
            "done_reason": say.finish or "stop",
            **counts,
        }
    if call.protocol == "anthropic":
        usage = {"input_tokens": 1000, "output_tokens": 7}
        block = {"type": "text", "text": say.text}
        stop = {"stop_reason": say.finish or "end_turn", "stop_sequence": None}
        return {
            "id": "1",
            "type": "message",
            **message,
            "model": call.body["model"],
            "content": [block],
            **stop,
            "usage": usage,
        }
    choice = {"index": 0, "message": message, "finish_reason": say.finish or "stop"}
    usage = {"prompt_tokens": 1000, "completion_tokens": 7, "total_tokens": 1007}
    return {
        "id": "1",
        "object": "chat.completion",
        "created": 1,
        "model": call.body["model"],
        "choices": [choice],
        "usage": usage,
    }

"""Send HTTP requests for LiteLLM: those of a call alone, to the server that the user named, and OpenAI's key to no
other provider. No redirect is followed, and an answer is bounded while it arrives.

LiteLLM reads an answer in the form that it asked for, as a stream or whole. A server may answer in the other form: then
the answer is kept, and LiteLLM is called once more in the form of the answer, which it gets without another request.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from typing import Any

import httpx

from core.support.secrets import is_secret_name, remember
from plugins.vlms.litellm.unwrapping import (
    is_stream,
    unwrap,
    unwrap_error,
    unwrap_event,
)

MAX_BYTES = 2**25  # of an answer, unpacked
_SNIFFED = 64  # bytes at an answer's beginning by which a stream is known
_STREAMS = ("text/event-stream", "application/x-ndjson", "amazon.eventstream")
LONGEST_ERROR = 10_000  # bytes
LONGEST = 10  # times the longest silence, that a call may take though its server lives

SHORTEST_KEY = 16  # of a provider; what is shorter may be a part of any header

OPENAI = ("openai", "text-completion-openai")
"""Providers that OPENAI_API_KEY is for, at any address."""


class TimedOut(Exception):
    """A call exceeded its time limit."""


class Life:
    """When a server last gave a sign of life: bytes of an answer that are not all blank.

    Args:
        silence_s: a call is given up when its server is silent for longer, or when it takes `LONGEST` times as long.
    """

    def __init__(self, silence_s: float) -> None:
        self._silence_s = silence_s
        self._at = time.monotonic()
        self._end = self._at + LONGEST * silence_s

    def show(self) -> None:
        """Note a sign of life."""
        self._at = time.monotonic()

    @contextmanager
    def watch(self) -> Iterator[None]:
        """Give a step of a call up that brings no sign of life, also where blanks keep its connection alive.

        Raises:
            TimedOut: the server is silent, or the call lasts, for too long.
        """
        limit = f"{self._silence_s:g}"
        try:
            yield
        except httpx.TimeoutException as error:
            raise TimedOut(f"no answer within {limit} s") from error

        if time.monotonic() > self._end:
            raise TimedOut(
                f"the answer takes too long: {LONGEST} times vlm.timeout_s={limit}"
            )
        if time.monotonic() > self._at + self._silence_s:
            raise TimedOut(f"no answer within {limit} s")


@dataclass(frozen=True)
class Answer:
    """A whole answer; ``streamed``: it has the form of a stream."""

    status: int
    headers: list[tuple[str, str]]
    content: bytes
    streamed: bool

    def respond(self, request: httpx.Request) -> httpx.Response:
        """Make what LiteLLM's clients read."""
        return httpx.Response(
            self.status, headers=self.headers, content=self.content, request=request
        )


@dataclass(eq=False)
class Call:
    """A call that a thread is making.

    Attributes:
        provider: in LiteLLM's words.
        server: the address that the user named; None: the provider's own.
        streams: LiteLLM asks for a stream.
        life: where signs of life are noted.
        kept: an answer to be given without a request.
        answered: an answer came that tells of no error.
    """

    provider: str
    server: httpx.URL | None
    streams: bool
    life: Life
    kept: Answer | None = None
    answered: bool = False


class EmptyStream(Exception):
    """A stream came without an event: some servers fail so, and say why where they are asked for a whole answer."""


class _Sender(threading.local):
    """The call that a thread is making; None: none."""

    call: Call | None = None


_sender = _Sender()


class OtherForm(Exception):
    """An answer came whole where a stream was asked for, or as a stream where it was not."""

    def __init__(self, answer: Answer) -> None:
        super().__init__("the answer has another form than the one asked for")
        self.answer = answer


class BadAnswer(Exception):
    """An answer that is not read; the message is one line, without keys. Another try would come to the same."""


class Unanswered(BadAnswer):
    """No answer came, or none that says anything of the request."""


class Unreadable(Unanswered):
    """An answer that tells of no error, and that LiteLLM can't read, such as a web page; it is asked for again."""

    status_code = 502  # what a gateway calls that


@contextmanager
def calling(call: Call) -> Iterator[None]:
    """Let the requests of a call pass while this thread makes it.

    Raises:
        BadAnswer: of an answer that is not read, whatever LiteLLM makes of it.
        OtherForm: the answer has the form that was not asked for.
    """
    _sender.call = call
    try:
        yield
    except Exception as error:
        cause = _find_cause(error)
        if cause is None and call.answered:
            why = f"{type(error).__name__}: {error}"
            cause = Unreadable(f"the answer can't be read: {why}")
        raise cause or error from None
    finally:
        _sender.call = None


def _find_cause(error: Exception) -> Exception | None:
    """Find what this module raised behind an error of LiteLLM's; None: nothing."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, BadAnswer | OtherForm | EmptyStream | TimedOut):
            return cause

        original = getattr(cause, "original_exception", None)
        cause = original or cause.__cause__ or cause.__context__

    return None


def transport(**settings: Any) -> httpx.BaseTransport:
    """Make the transport for all of LiteLLM's clients; ``settings`` are those of `httpx.Client`, such as ``verify``."""
    # A client of its own, since httpx looks at the environment's proxies only there.
    limits = httpx.Limits(max_connections=None, max_keepalive_connections=20)
    hooks = {"response": [_refuse_redirect]}  # before httpx looks where it leads
    return _Transport(
        httpx.Client(
            follow_redirects=False, event_hooks=hooks, limits=limits, **settings
        )
    )


class _Transport(httpx.BaseTransport):
    """Shared by clients and threads; closing a client leaves it open."""

    def __init__(self, client: httpx.Client) -> None:
        self._client = client

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        """Send the request.

        Raises:
            BadAnswer: the answer is a redirect or too large; or the request would go where the user did not send it.
            OtherForm: the answer has the form that was not asked for.
            EmptyStream: a stream ends, or breaks off, before its first event.
        """
        call = _sender.call
        if call is None:
            raise Unanswered(
                f"LiteLLM asks {request.url.host} without a call; that is not sent"
            )

        call.answered = False
        if call.kept is not None:
            call.answered = call.kept.status < 400
            return call.kept.respond(request)

        _check_server(request.url, call)
        _keep_openai(request, call)

        for name, value in request.headers.items():
            if is_secret_name(name):
                remember(value)

        with call.life.watch():
            answer = self._client.send(request, stream=True)
        parts = _read(answer, call.life)
        try:
            streamed, parts = _is_streamed(answer, parts)
        except BaseException:
            answer.close()
            raise

        headers = _keep_headers(answer)
        if streamed and call.streams and answer.is_success:
            call.answered = True
            beginning = _await_event(parts)
            if not beginning:
                answer.close()
                raise EmptyStream("the server sent an empty stream")

            stream = _Stream(answer, chain([beginning], parts))
            return httpx.Response(
                answer.status_code, headers=headers, stream=stream, request=request
            )

        try:
            content = b"".join(parts)
        finally:
            answer.close()

        return _whole(call, answer, headers, content, streamed).respond(request)


def _whole(
    call: Call,
    answer: httpx.Response,
    headers: list[tuple[str, str]],
    content: bytes,
    streamed: bool,
) -> Answer:
    """Bring an answer that was read to its end into the form that LiteLLM reads.

    Args:
        call: that it answers.
        answer: as the server sent it.
        headers: of it, that are kept.
        content: all of it, unpacked.
        streamed: it has the form of a stream.

    Raises:
        OtherForm: it has the form that was not asked for.
    """
    status = answer.status_code
    if status == httpx.codes.OK and not streamed:
        status, content = unwrap(content)
    elif status >= 400:
        content = unwrap_error(content)

    call.answered = status < 400
    if status >= 400:
        content = content[:LONGEST_ERROR]  # LiteLLM searches errors for many words

    whole = Answer(status, headers, content, streamed)
    if call.answered and streamed != call.streams:
        raise OtherForm(whole)

    return whole


class _Stream(httpx.SyncByteStream):
    """The bytes of an answer as they arrive, with each event in the form that LiteLLM reads."""

    def __init__(self, answer: httpx.Response, parts: Iterator[bytes]) -> None:
        self._answer = answer
        self._parts = parts

    def __iter__(self) -> Iterator[bytes]:
        rest = b""
        for part in self._parts:
            *lines, rest = (rest + part).split(b"\n")
            for line in lines:
                yield unwrap_event(line) + b"\n"

        if rest:
            yield unwrap_event(rest)

    def close(self) -> None:
        self._answer.close()


def _keep_headers(answer: httpx.Response) -> list[tuple[str, str]]:
    """Return an answer's headers, without those of the way that it came."""
    hop = ("content-encoding", "content-length", "transfer-encoding")
    return [
        (name, value) for name, value in answer.headers.multi_items() if name not in hop
    ]


def _is_streamed(
    answer: httpx.Response, parts: Iterator[bytes]
) -> tuple[bool, Iterator[bytes]]:
    """Say if an answer has the form of a stream, by its type or its beginning; return all its parts too."""
    kind = answer.headers.get("content-type", "")
    if any(name in kind for name in _STREAMS):
        return True, parts

    beginning = b""
    for part in parts:
        beginning += part
        if len(beginning.strip()) >= _SNIFFED:
            break

    return is_stream(beginning), chain([beginning], parts)


def _await_event(parts: Iterator[bytes]) -> bytes:
    """Return a stream's bytes with its first event; empty: it ends or breaks off before there is one.

    Comments before it, by which a server shows that it lives, are left out.
    """
    rest = b""
    try:
        for part in parts:
            *lines, rest = (rest + part).split(b"\n")
            if any(line.strip() and line[:1] != b":" for line in (*lines, rest)):
                return b"\n".join((*lines, rest))
    except httpx.RemoteProtocolError:  # it broke off
        return b""

    return b""


def _check_server(target: httpx.URL, call: Call) -> None:
    """Check that a request goes to the server that the user named.

    LiteLLM looks models up at addresses of its own, and some of its providers know no other address than their maker's.

    Raises:
        Unanswered: it does not.
    """
    named = call.server
    if named is None or _origin(target) == _origin(named):
        return
    raise Unanswered(
        f"LiteLLM would send requests of {call.provider} to {target.host}, not to {named.host}: they are not sent; "
        "for a server of your own write vlm.model=openai/NAME, for the provider's leave out vlm.api_base"
    )


def _origin(url: httpx.URL) -> tuple[str, int]:
    ports = {"http": 80, "https": 443}
    return url.host, url.port or ports.get(url.scheme, 0)


def _keep_openai(request: httpx.Request, call: Call) -> None:
    """Take what is OpenAI's out of requests to others, since LiteLLM puts it into all that lack something of their own.

    Raises:
        Unanswered: it is the key, or the request is another provider's and would go to OpenAI.
    """
    host = request.url.host
    is_openai = call.provider in OPENAI
    if is_openai and f".{host}".endswith(".openai.com"):
        return

    for name in [name for name in request.headers if name.startswith("openai-")]:
        del request.headers[name]
    # LiteLLM's default for servers of one's own
    if host == "api.openai.com" and not is_openai:
        raise Unanswered(
            f"requests of {call.provider} would go to {host}; set vlm.api_base"
        )

    key = os.environ.get("OPENAI_API_KEY")
    if is_openai or not key:
        return

    # A key in the provider's own variables may be equal to OpenAI's, such as ``EMPTY``.
    prefix = call.provider.upper().replace("-", "_")
    for name, value in os.environ.items():
        if value == key and is_secret_name(name) and name.startswith(prefix):
            return

    for value in request.headers.values():
        # What is as short as what stands for no key counts as a whole word alone.
        words = value if len(key) >= SHORTEST_KEY else value.split()
        if key in words:
            raise Unanswered(
                f"OPENAI_API_KEY would go to {host}; set {prefix}_API_KEY, the variable of {call.provider}"
            )


def _refuse_redirect(answer: httpx.Response) -> None:
    """Raise Unanswered for a redirect.

    It names the host, but neither path nor query, which may repeat a key.
    """
    if not 300 <= answer.status_code < 400:
        return

    try:
        target = answer.url.join(answer.headers.get("location", ""))
        there = target.host
        if there == answer.url.host:
            there = f"{target.scheme}://{target.netloc.decode()}"
    except (httpx.InvalidURL, ValueError, TypeError):
        there = "an address that can't be read"

    raise Unanswered(
        f"{answer.url.host} redirects to {there or 'nowhere'} (status {answer.status_code}), which is not followed: "
        "the key would go there; set vlm.api_base to the right address"
    )


def _read(answer: httpx.Response, life: Life) -> Iterator[bytes]:
    """Yield the parts of an answer as they arrive, within the limits of size and time.

    Args:
        answer: of which nothing is read yet.
        life: where signs of life are noted; blanks are none.

    Raises:
        BadAnswer: the answer is too large.
        TimedOut: the server is silent for too long.
    """
    size = 0
    parts = answer.iter_bytes()
    while True:
        with life.watch():
            part = next(parts, None)
        if part is None:
            return

        size += len(part)
        if size > MAX_BYTES:
            raise BadAnswer(
                f"the answer is larger than {MAX_BYTES >> 20} MiB; the rest is not read"
            )

        if part.strip():
            life.show()

        yield part

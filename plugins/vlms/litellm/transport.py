"""Send HTTP requests for LiteLLM: those of a call alone, to the server that the user named, and OpenAI's key to no
other provider. No redirect is followed, and an answer is bounded while it arrives.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx

from core.support.secrets import is_secret_name, remember
from plugins.vlms.litellm.answers import unwrap

MAX_BYTES = 2**25  # of an answer, unpacked
LONGEST_ERROR = 10_000  # bytes

SHORTEST_KEY = 16  # of a provider; what is shorter may be a part of any header

OPENAI = ("openai", "text-completion-openai")
"""Providers that OPENAI_API_KEY is for, at any address."""


class _Sender(threading.local):
    """The call that a thread is making: ``provider`` is empty where it makes none.

    ``server`` is the address that the user named, None: the provider's own. ``answered``: an answer came that tells of
    no error.
    """

    provider = ""
    server: httpx.URL | None = None
    answered = False


_sender = _Sender()


class BadAnswer(Exception):
    """An answer that is not read; the message is one line, without keys. Another try would come to the same."""


class Unanswered(BadAnswer):
    """No answer came, or none that says anything of the request."""


class Unreadable(Unanswered):
    """An answer that tells of no error, and that LiteLLM can't read, such as a web page; it is asked for again."""

    status_code = 502  # what a gateway calls that


@contextmanager
def calling(provider: str, server: httpx.URL | None) -> Iterator[None]:
    """Let the requests of a call pass while this thread makes it.

    Raises:
        BadAnswer: of an answer that is not read, whatever LiteLLM makes of it.
    """
    _sender.provider = provider
    _sender.server = server
    _sender.answered = False
    try:
        yield
    except Exception as error:
        cause: BaseException | None = error
        while cause is not None and not isinstance(cause, BadAnswer):
            cause = cause.__cause__ or cause.__context__
        if cause is None and _sender.answered:
            why = f"{type(error).__name__}: {error}"
            cause = Unreadable(f"the answer can't be read: {why}")
        raise cause or error from None
    finally:
        _sender.provider = ""


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
        """
        _sender.answered = False
        _check_server(request.url)
        _keep_openai(request)

        for name, value in request.headers.items():
            if is_secret_name(name):
                remember(value)

        seconds = request.extensions.get("timeout", {}).get("read")
        deadline = None if seconds is None else time.monotonic() + seconds
        answer = self._client.send(request, stream=True)
        try:
            content = _read(answer, deadline)
        finally:
            answer.close()

        status = answer.status_code
        if status == httpx.codes.OK:
            status, content = unwrap(content)

        _sender.answered = status < 400
        if answer.is_error:
            content = content[:LONGEST_ERROR]  # LiteLLM searches errors for many words

        hop = ("content-encoding", "content-length", "transfer-encoding")
        headers = [
            (name, value)
            for name, value in answer.headers.multi_items()
            if name not in hop
        ]
        return httpx.Response(status, headers=headers, content=content, request=request)


def _check_server(target: httpx.URL) -> None:
    """Check that a request belongs to a call, and goes to the server that the user named.

    LiteLLM looks models up at addresses of its own, and some of its providers know no other address than their maker's.

    Raises:
        Unanswered: it does not.
    """
    if not _sender.provider:
        raise Unanswered(f"LiteLLM asks {target.host} without a call; that is not sent")
    named = _sender.server
    if named is None or _origin(target) == _origin(named):
        return
    raise Unanswered(
        f"LiteLLM would send requests of {_sender.provider} to {target.host}, not to {named.host}: they are not sent; "
        "for a server of your own write vlm.model=openai/NAME, for the provider's leave out vlm.api_base"
    )


def _origin(url: httpx.URL) -> tuple[str, int]:
    ports = {"http": 80, "https": 443}
    return url.host, url.port or ports.get(url.scheme, 0)


def _keep_openai(request: httpx.Request) -> None:
    """Take what is OpenAI's out of requests to others, since LiteLLM puts it into all that lack something of their own.

    Raises:
        Unanswered: it is the key, or the request is another provider's and would go to OpenAI.
    """
    host = request.url.host
    is_openai = _sender.provider in OPENAI
    if is_openai and f".{host}".endswith(".openai.com"):
        return

    for name in [name for name in request.headers if name.startswith("openai-")]:
        del request.headers[name]
    # LiteLLM's default for servers of one's own
    if host == "api.openai.com" and not is_openai:
        raise Unanswered(
            f"requests of {_sender.provider} would go to {host}; set vlm.api_base"
        )

    key = os.environ.get("OPENAI_API_KEY")
    if is_openai or not key or key in _own_keys():
        return
    if any(_holds(value, key) for value in request.headers.values()):
        raise Unanswered(
            f"OPENAI_API_KEY would go to {host}; set {_prefix()}_API_KEY, the variable of {_sender.provider}"
        )


def _holds(value: str, key: str) -> bool:
    """Report whether a header holds a key: anywhere in it, or as a word if it is as short as what stands for none."""
    return key in value if len(key) >= SHORTEST_KEY else key in value.split()


def _own_keys() -> list[str]:
    """Return the keys in the provider's own variables; one may be equal to OpenAI's, such as ``EMPTY``."""
    return [
        value
        for name, value in os.environ.items()
        if is_secret_name(name) and name.startswith(_prefix())
    ]


def _prefix() -> str:
    return _sender.provider.upper().replace("-", "_")


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


def _read(answer: httpx.Response, deadline: float | None) -> bytes:
    """Read a whole answer within the limits of size and time.

    Args:
        answer: of which nothing is read yet.
        deadline: on the monotonic clock; None: no limit.

    Raises:
        BadAnswer: it is too large.
    """
    content = bytearray()
    for part in answer.iter_bytes():
        content += part
        if len(content) > MAX_BYTES:
            raise BadAnswer(
                f"the answer is larger than {MAX_BYTES >> 20} MiB; the rest is not read"
            )

        if deadline is not None and time.monotonic() > deadline:
            raise httpx.ReadTimeout("the answer takes too long", request=answer.request)

    return bytes(content)

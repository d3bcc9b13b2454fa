"""Find keys, tokens and passwords in text, and replace them by stars.

All text of a model, and all that a command prints or a run stores, passes `scrub`.
"""

from __future__ import annotations

import os
import re
from collections import deque
from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import Any, TextIO
from urllib.parse import quote

SHORTEST = 8  # a shorter value is no key, and its stars would damage the text
_LONG = 16  # a word of a value, such as a token after "Bearer", is a secret by itself from this length

_NAME = re.compile(
    r"API_?KEYS?(_|$)|(^|_)(KEY|JWT|PAT|PASS|HEADERS)(_|$)|(TOKEN|SECRET|PASSWORD|PASSWD|PASSPHRASE)(_|$)"
    r"|CREDENTIALS?(_|$)|BEARER(_|$)|AUTHORIZATION(_|$)|WEBHOOK|COOKIE|(^|_)AUTH$|(^|_)SIG(NATURE)?$"
)
# Before the host: a password, or a token alone.
_BEFORE_HOST = re.compile(r":[/\\]{2}(?:[^/\s:@]*:)?([^/\s@]+)@")
# A password with a slash in it; what begins with a port is none, nor is what begins in brackets.
_WITH_SLASH = re.compile(
    r":[/\\]{2}(?!\[)[^\s:@/?#\\]*:(?!\d{0,5}(?:[/?#\\,]|$))([^\s@]+)@"
)
# Before a host that is a name with a point, or has a port or a path; addresses of mail are none.
_WITHOUT_SCHEME = re.compile(
    r"(?<![^\s=,\[\"'/])(?<!://)(?!mailto:)\w[^\s:@/\\]*:(?![/\\]{2}|\d{0,5}(?:[/?#\\,]|$))([^\s@]+)@"
    r"(?:localhost\b|[\w-]+(?:\.[\w-]+)+|[\w-]+(?=/|:\d{1,5}(?!\w)))"
)
_IN_QUERY = re.compile(r"[?&;#]([\w.-]+)=([^&\s#;]+)")

# What requests carried lately, such as a session's token.
_sent: deque[str] = deque(maxlen=50)


@lru_cache(maxsize=1024)
def is_secret_name(name: str) -> bool:
    """Say if an environment variable, a header or a field of this name holds a key, a token or a password."""
    return _NAME.search(name.upper().replace("-", "_")) is not None


def remember(value: str) -> None:
    """Treat ``value``, which was sent as a key, as a secret from now on."""
    if value not in _sent:
        _sent.append(value)


def scrub(text: str) -> str:
    """Replace keys by stars, as they are and as they stand in an address (``%2F`` for a slash)."""
    return scrub_all([text])[0]


def scrub_all(texts: Iterable[str]) -> list[str]:
    """Scrub texts that are written together, such as a row's: the environment is looked through once for all."""
    spellings = []
    for secret in sorted(_secrets(), key=len, reverse=True):
        spellings += [secret, quote(secret, safe="", errors="replace")]

    return [_star(text, spellings) for text in texts]


def holds_secret(text: str) -> bool:
    """Say if a text holds a key of the environment, or a key within an address."""
    return scrub(text) != text or any(_in_addresses(text))


class Scrubbed:
    """A text stream, such as standard error, whose writes are scrubbed."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        self._stream.write(scrub(text))
        return len(text)

    def writelines(self, lines: list[str]) -> None:
        for line in lines:
            self.write(line)

    def close(self) -> None:
        """Stay open: closing a command's stream would take it from all others."""
        self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _star(text: str, spellings: list[str]) -> str:
    for spelling in spellings:
        text = text.replace(spelling, "***")
    return text


def _secrets() -> Iterator[str]:
    """Yield the values that are secrets now, and the long words in them."""
    for value in (*_sent, *_environment()):
        if len(value.strip()) >= SHORTEST:
            yield value.strip()
        yield from (word for word in value.split() if len(word) >= _LONG)


def _environment() -> Iterator[str]:
    """Yield the environment's keys, and those in its addresses."""
    for name, value in os.environ.items():
        if is_secret_name(name) and not os.path.exists(value):  # noqa: PTH110 - or a file that holds the key
            yield value
        else:
            yield from _find_in_variable(value)


@lru_cache(maxsize=1024)
def _find_in_variable(value: str) -> tuple[str, ...]:
    """Find the secrets in the addresses of an environment variable, which hardly ever changes; texts are many."""
    return tuple(_in_addresses(value))


def _in_addresses(text: str) -> Iterator[str]:
    """Yield passwords, tokens and signatures in the addresses of a text."""
    if "@" in text:
        yield from _BEFORE_HOST.findall(text)
        yield from _WITH_SLASH.findall(text)
        yield from _WITHOUT_SCHEME.findall(text)

    for name, value in _IN_QUERY.findall(text):
        if is_secret_name(name):
            yield value

"""Find keys, tokens and passwords in text, and replace them by stars.

All text of a model, and all that a command prints or a run stores, passes `scrub`.
"""

from __future__ import annotations

import base64
import contextlib
import html
import json
import os
import re
from collections import deque
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, TextIO

import numpy as np

SHORTEST = 8  # a shorter value is no key, and its stars would damage the text

_NAME = re.compile(
    r"API_?KEYS?(_|$)|(^|_)(KEY|JWT|PAT|PASS|HEADERS)(_|$)|(TOKEN|SECRET|PASSWORD|PASSWD|PASSPHRASE)(_|$)"
    r"|CREDENTIALS?(_|$)|BEARER(_|$)|AUTHORIZATION(_|$)|WEBHOOK|COOKIE|(^|_)AUTH$"
)
_IN_ADDRESS = re.compile(r"://[^/\s:@]*:([^/\s@]+)@")
_UNSEEN = (
    r"[\0-\x08\x0e-\x1f\x7f-\x9f\xad\u200b-\u200f\u202a-\u202e\u2060-\u206f\ufeff\ud800-\udfff\U000e0000-\U000e0fff]"
)
_WRITTEN = re.compile(
    r"\\+u([0-9a-fA-F]{4})|\\+x([0-9a-fA-F]{2})|%([0-9a-fA-F]{2})|&#x([0-9a-fA-F]{1,5});"
    rf"|&#(\d{{1,6}});|&(amp|lt|gt|quot|apos);|\\+((?!{_UNSEEN}).)|{_UNSEEN}",
    re.DOTALL,
)
_ESCAPED = {"n": "\n", "r": "\r", "t": "\t", "b": "", "f": "\f"}

_sent: deque[str] = deque(maxlen=50)  # what requests carried lately, such as a session's token


def is_secret_name(name: str) -> bool:
    """Say if an environment variable, a header or a field of this name holds a key, a token or a password."""
    return _NAME.search(name.upper().replace("-", "_")) is not None


def remember(value: str) -> None:
    """Treat ``value``, which was sent as a key, as a secret from now on."""
    if value not in _sent:
        _sent.append(value)


def scrub(text: str) -> str:
    """Replace keys by stars: as they are, escaped in any way, or in base64 or hexadecimal digits."""
    forms = _forms(frozenset(_values()))
    if not forms:
        return text
    plain = _WRITTEN.sub(_character, text)
    written = [re.escape(form) for form in forms if form in plain]
    if not written:
        return text
    seen = np.ones(len(text) + 1, dtype=bool)  # where a character of the plain text stands, or begins if it is escaped
    bound = seen.copy()  # where it may end
    for match in _WRITTEN.finditer(text):
        seen[match.start() + len(_character(match)) : match.end()] = False
        bound[match.start() + 1 : match.end()] = False
    places, bounds = np.flatnonzero(seen), np.flatnonzero(bound)
    pieces, last = [], 0
    for match in re.finditer("|".join(written), plain):
        pieces += [text[last : places[match.start()]], "***"]
        last = bounds[np.searchsorted(bounds, places[match.end() - 1], side="right")]
    return "".join([*pieces, text[last:]])


def scrubbed(value: Any) -> Any:
    """Scrub a text, or all texts in a JSON value."""
    if isinstance(value, str):
        return scrub(value)
    if isinstance(value, dict):
        return {scrubbed(key): scrubbed(item) for key, item in value.items()}
    return [scrubbed(item) for item in value] if isinstance(value, list | tuple) else value


def holds_secret(text: str) -> bool:
    """Say if a text holds a key of the environment, or a password within an address."""
    return scrub(text) != text or _IN_ADDRESS.search(text) is not None


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

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _values() -> Iterator[str]:
    """The values that are secrets now."""
    yield from _sent
    for name, value in os.environ.items():
        if len(value) < SHORTEST:
            continue
        if is_secret_name(name) and not (value[0] in "/~." and os.path.exists(value)):  # noqa: PTH110 - or its name
            yield value
        elif "@" in value:
            yield from _IN_ADDRESS.findall(value)


@lru_cache(maxsize=8)
def _forms(values: frozenset[str]) -> tuple[str, ...]:
    """All texts to look for, the longest first."""
    forms: set[str] = set()
    for value in values:
        for part in _parts(value):
            forms |= _written(part)
    return tuple(sorted(forms, key=lambda form: (-len(form), form)))


def _parts(value: str) -> Iterator[str]:
    """A secret and the words in it that are long or have digits; of a JSON document, its secret fields."""
    document = None
    if value.lstrip().startswith("{"):
        with contextlib.suppress(ValueError, RecursionError):
            document = json.loads(value)
    if document is not None:
        for name, field in document.items():
            if isinstance(field, dict) or (isinstance(field, str) and is_secret_name(name)):
                yield from _parts(field if isinstance(field, str) else json.dumps(field))
        return
    for text in (value, _WRITTEN.sub(_character, value)):
        words = [word for word in text.split() if len(word) >= 16 or re.search(r"\d", word)]
        yield from (word for word in (text.strip(), *words) if len(word) >= SHORTEST)


def _written(secret: str) -> set[str]:
    data = secret.encode("utf-8", "surrogatepass")
    forms = {secret, data.decode("latin-1"), data.hex(), data.hex().upper()}
    for before in range(3):  # wherever the secret begins within what is encoded
        for encode in (base64.standard_b64encode, base64.urlsafe_b64encode):
            encoded = encode(b"\0" * before + data).decode()
            first = (8 * before + 5) // 6
            forms.add(encoded[first : 8 * (before + len(data)) // 6])
    return forms


def _character(match: re.Match[str]) -> str:
    """The character that is written in an escaped form; empty: one that can't be seen."""
    utf16, byte, percent, hexadecimal, decimal, named, escaped = match.groups()
    if number := utf16 or byte or percent or hexadecimal:
        character = chr(int(number, 16))
    elif decimal:
        character = chr(int(decimal))
    elif named:
        character = html.unescape(match.group())
    else:
        character = _ESCAPED.get(escaped, escaped) if escaped else ""
    return re.sub(_UNSEEN, "", character)

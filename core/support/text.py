"""Untrusted text, made safe to print."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

# What Hydra reads as a text: no number, and none of its other values.
_PLAIN = re.compile(
    r"(?!(true|false|null|inf|nan)$)[a-z/][\w./+-]*", re.IGNORECASE | re.ASCII
)


_MOST_DIGITS = 6  # of a value beside its limit: what is nearer is rounding


def clean(text: str, longest: int, *, lines: bool = False) -> str:
    """Remove control characters and superfluous space from ``text``, and cut it to ``longest`` characters.

    It becomes one line, or keeps its own ``lines``.
    """
    kept = "".join(c for c in text if c.isprintable() or c.isspace())
    rows = kept.splitlines() if lines else [kept]
    words = [" ".join(row.split()) for row in rows]

    return _cut("\n".join(filter(None, words)), longest)


def _cut(text: str, longest: int) -> str:
    return text if len(text) <= longest else text[: longest - 3] + "..."


def visible(text: str) -> str:
    """Escape what is not printable.

    That is control characters, line breaks, marks that turn the direction, and surrogates.
    """
    escaped = [
        letter if letter.isprintable() else letter.encode("unicode_escape").decode()
        for letter in text
    ]

    return "".join(escaped)


def kind(value: object) -> str:
    """Describe the type of a JSON value, for a reason: ``a list``, ``null``, or ``the text 'abc'``."""
    if isinstance(value, str):
        return f"the text {shorten(value)}"
    name = type(value).__name__

    return _JSON_TYPES.get(name, f"a {name}")


_JSON_TYPES = {
    "dict": "an object",
    "list": "a list",
    "bool": "a boolean",
    "NoneType": "null",
    "int": "a number",
    "float": "a number",
}


def short_number(value: float, digits: int) -> str:
    """Write a number with at most ``digits`` after the point, and never as -0."""
    return f"{round(float(value), digits) + 0.0:g}"


def short_numbers(values: Iterable[float], digits: int, between: str = " ") -> str:
    """Write numbers, each with at most ``digits`` after the point."""
    return between.join(short_number(value, digits) for value in values)


def shorten(text: str, length: int = 40) -> str:
    """Quote ``text``, cut to ``length`` characters, as for a reason that repeats what a model wrote."""
    return repr(_cut(text, length))


def list_some(names: Sequence[object], most: int) -> str:
    """List the first of some names, and say how many more there are."""
    listed = ", ".join(map(str, names[:most]))
    if len(names) > most:
        listed += f" and {len(names) - most} more"

    return listed


def number(value: float | None, digits: int) -> str:
    """Write ``value`` with ``digits`` after the point.

    A value just below 1 stays below it, so that no reward looks like a success that is none. What is not known is a
    dash.
    """
    if value is None or not math.isfinite(value):
        return "–"
    if digits and value < 1:
        value = min(value, 1 - 10.0**-digits)

    return f"{value:.{digits}f}"


def number_beside(value: float, limit: float, digits: int = 3) -> str:
    """Write a value beside its limit: with so many digits, and more where it would read as the limit that it is not.

    For example 15.02 beside 15 is ``15.02``, and 22.41 is ``22.4``.
    """
    written = f"{value:.{digits}g}"
    while value != limit and float(written) == float(f"{limit:.{digits}g}"):
        digits += 1
        written = f"{value:.{digits}g}"
        if digits > _MOST_DIGITS:
            break

    return written


class Reason(NamedTuple):
    """Why some earned nothing or less: in words, how many there are, and the name of the first."""

    text: str
    times: int
    first: str

    @property
    def whose(self) -> str:
        """How many there are, and the first."""
        if self.times == 1:
            return self.first
        return f"{self.times} times, first {self.first}"

    def __str__(self) -> str:
        return f"{self.whose}: {self.text}"


def by_reason(candidates: Iterable[tuple[str, str]]) -> list[Reason]:
    """Group candidates, each with the reason why it earned nothing or less, if it did; common reasons come first.

    Reasons that differ in numbers alone count as one, in the words of the first.
    """
    found: dict[str, Reason] = {}
    for name, words in candidates:
        if words:
            text = clean(words, 300)
            alike = hide_numbers(text)
            known = found.get(alike, Reason(text, 0, name))
            found[alike] = known._replace(times=known.times + 1)

    return sorted(found.values(), key=lambda reason: -reason.times)


def hide_numbers(text: str) -> str:
    """Put a 0 in the place of each number, to compare texts that differ in numbers alone."""
    return re.sub(r"[\d.]*\d", "0", text)


def hydra_word(value: object) -> str:
    """Write a value as on the command line, so that Hydra reads the same value again.

    A text that Hydra's grammar would read as something else is put in double quotes: a shell's single quotes go around
    them as they are.
    """
    if value is None:
        return "null"
    if isinstance(value, list | tuple):
        return f"[{','.join(map(hydra_word, value))}]"

    if isinstance(value, Mapping):
        items = [f"{hydra_word(key)}:{hydra_word(value[key])}" for key in value]
        return f"{{{','.join(items)}}}"

    if isinstance(value, bool | int | float):
        return str(value).lower()

    text = str(value)
    if _PLAIN.fullmatch(text):
        return text
    quoted = text.replace('"', '\\"')

    return f'"{quoted}"'


def count_words(count: int, noun: str) -> str:
    """Write a number with its noun."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"

"""Untrusted text, made safe to print."""

from __future__ import annotations

import ast
import inspect
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any


def clean(text: str, longest: int, *, lines: bool = False) -> str:
    """Remove control characters and superfluous space from ``text``, and cut it to ``longest`` characters.

    It becomes one line, or keeps its own ``lines``.
    """
    visible = "".join(
        character
        for character in text
        if character.isprintable() or character.isspace()
    )
    rows = [
        " ".join(row.split()) for row in (visible.splitlines() if lines else [visible])
    ]
    kept = "\n".join(filter(None, rows))
    return kept if len(kept) <= longest else kept[: longest - 3] + "..."


def visible(text: str) -> str:
    """Escape what is not printable: control characters, line breaks, marks that turn the direction, surrogates."""
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode("ascii")
        for c in text
    )


def kind(value: object) -> str:
    """Describe the type of a JSON value, for a reason."""
    names: dict[type, str] = {
        dict: "an object",
        list: "a list",
        bool: "a boolean",
        type(None): "null",
    }
    if isinstance(value, str):
        return f"the text {shorten(value)}"
    if isinstance(value, int | float) and not isinstance(value, bool):
        return "a number"
    return names.get(type(value), f"a {type(value).__name__}")


def short_number(value: float, digits: int) -> str:
    """Write a number with at most ``digits`` after the point, and never as -0."""
    return f"{round(float(value), digits) + 0.0:g}"


def short_numbers(values: Iterable[float], digits: int, between: str = " ") -> str:
    """Write numbers, each with at most ``digits`` after the point."""
    return between.join(short_number(value, digits) for value in values)


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a Markdown table; no text of a cell ends its cell or row."""
    lines = [
        [" ".join(cell.split()).replace("|", r"\|") for cell in row]
        for row in (columns, *rows)
    ]
    lines.insert(1, ["---"] * len(columns))
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def shorten(text: str, length: int = 40) -> str:
    """Quote ``text``, cut to ``length`` characters."""
    return repr(text if len(text) <= length else text[: length - 3] + "...")


def number(value: float | None, digits: int) -> str:
    """``value`` with ``digits`` after the point; a value just below 1 stays below it."""
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:.{digits}f}"
    if digits and value < 1 and float(text) >= 1:
        return f"{math.floor(value * 10**digits) / 10**digits:.{digits}f}"
    return text


def by_reason(candidates: Iterable[tuple[str, str]]) -> list[str]:
    """Group candidates, each with the reason why it earned nothing or less; a line for each reason, common ones first.

    Reasons that differ in numbers alone count as one. Its line has the number of candidates and the first one's reason.
    """
    groups: dict[str, list[tuple[str, str]]] = {}
    for name, reason in candidates:
        if reason:
            groups.setdefault(re.sub(r"[\d.]*\d", "0", clean(reason, 300)), []).append(
                (name, clean(reason, 300))
            )
    ordered = sorted(groups.values(), key=lambda of: -len(of))
    return [
        f"{len(of)} times, first {of[0][0]}: {of[0][1]}"
        if len(of) > 1
        else ": ".join(of[0])
        for of in ordered
    ]


def hydra_word(value: object) -> str:
    """Write a value as on the command line."""
    if value is None:
        return "null"
    if isinstance(value, list | tuple):
        return f"[{','.join(map(hydra_word, value))}]"
    if isinstance(value, Mapping):
        return f"{{{','.join(f'{hydra_word(key)}:{hydra_word(item)}' for key, item in value.items())}}}"
    if isinstance(value, bool):
        return str(value).lower()
    text = str(value)
    return (
        text
        if re.fullmatch(r"[\w./+-]+", text)
        else "'" + text.replace("'", "\\'") + "'"
    )


@lru_cache
def function_source(function: Callable[..., Any]) -> str:
    """Take a function's source without its docstring."""
    lines, (node,) = (
        inspect.getsource(function).splitlines(),
        ast.parse(inspect.getsource(function)).body,
    )
    assert isinstance(node, ast.FunctionDef)
    if ast.get_docstring(node) is not None:
        del lines[node.body[0].lineno - 1 : node.body[0].end_lineno]
    return "\n".join(lines)

"""Mend malformed JSON, or read YAML, without ever changing a number: what can't be read for certain is refused."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import json_repair
import yaml

from core.design import DesignError
from core.support.text import shorten
from plugins.replies.decoding import DECODER
from plugins.replies.written_numbers import figures_in, has_unit, is_uneven, read_figure

MAX_MENDED = 40_000
"""The most characters that are mended at a time; a design has some 15,000. The time grows with their square."""

MAX_OPEN = 40
"""The most brackets that may be open at a time."""

ELLIPSIS = "..."

# Spaces and dashes of all kinds, a mark at the beginning, and other marks of typesetters.
_ODD = str.maketrans(
    dict.fromkeys("\u00a0\u2007\u202f\u2009\u3000", " ")
    | dict.fromkeys("\ufeff\u200b")
    | dict.fromkeys("\u2212\u2010\u2011\u2012\u2013\u2014\uff0d", "-")
    | dict(zip("，：；", ",:;", strict=True))
)
# A quote without an end is read once to the end, and not again from each quote in it.
_OPEN = r"\"(?:[^\"\\]++|\\.)*+\\?\Z"
_TEXT = rf"\"(?:[^\"\\]++|\\.)*+\"|{_OPEN}|(?<=[\[{{,:\s])'(?:[^'\\\n]++|\\.)*+'(?=\s*[\]}},:])"
_LONG = re.compile(r"(?<=[:\[,(\s])(\"\"\"|'''|`)(?=[^`'\"])(.*?)\1", re.DOTALL)
_IN_CURLY = r"(?<=[\[{,:\s])[“”„«]((?:[^\\“”„«»]++|\\.)*+)[“”»](?=\s*[\]},:])"
_CURLY = re.compile(
    rf"({_TEXT})|{_IN_CURLY}|(?<=[\[{{,:\s])[“”„«‘]|[“”»’](?=\s*[\]}},:])", re.DOTALL
)
_REMARK = (
    r"//[^\n]*|/\*.*?\*/|<!--.*?-->|(?<![^\s,\]}])#[^\n]*|\b(?:np|numpy)\.array(?=\()"
)
_COMMENT = re.compile(rf"({_TEXT})|{_REMARK}|,(?=\s*[\]}}])", re.DOTALL)
_BRACE = re.compile(rf"{_TEXT}|{_REMARK}|([{{}}])", re.DOTALL)
_BARE = re.compile(
    rf"({_TEXT})|(?<=[\[,:])(\s*)([^\s\"'\[\]{{}},:][^\"'\[\]{{}},:\n]*+)(?=\s*[,\]}}])",
    re.DOTALL,
)
_QUOTED = re.compile(_TEXT, re.DOTALL)
# Stands before a list, an object or a number, or as a loose quote behind a list or an object.
_JUNK = re.compile(
    r"[^\s\[{(,:\]][ \n]*[\[{]|[^\w\s\[\](){},:;+\-*/.~≈=][ \n]*[\d.]|[\]}][ \n]*['`]"
)
_OPENS = {"]": "[", "}": "{"}
_JSON_NUMBER = re.compile(r"-?\d+(\.\d+)?([eE][-+]?\d+)?")
_CODE = re.compile(r"\\u([0-9a-fA-F]{4})")
_YAML_COMMENT = re.compile(r"(?:(?<=\s)|(?<=\A))#[^\n]*")
# What YAML's constructors raise for values that are none.
_YAML_ERRORS = (yaml.YAMLError, LookupError, AttributeError, TypeError)


def mend_json(text: str) -> object:
    """Read one malformed JSON value.

    Comments are left out, sums of numbers are computed, and ``...`` becomes a text; the rest is `json_repair`'s work.
    Its result is taken only if it has the same numbers in the same order as the text.

    Raises:
        DesignError: it is too long, too deep, or can't be read for certain.
    """
    _refuse_large(text)
    plain = _LONG.sub(lambda match: _write_text(match[2]), text.translate(_ODD))
    plain = _CURLY.sub(_straighten, plain)
    plain = _COMMENT.sub(lambda match: match[1] or " ", plain)
    plain = _BARE.sub(_compute, plain)
    with suppress(ValueError, RecursionError):
        return DECODER.decode(plain)

    if not _is_nested(plain):
        raise DesignError("it is malformed, and its brackets do not say what is whose")

    return _read_surely(
        plain, lambda text: json_repair.loads(text, skip_json_loads=True)
    )


def read_yaml(text: str) -> object:
    """Read a YAML document.

    Raises:
        DesignError: it is too long, has tags or references, or can't be read for certain.
    """
    _refuse_large(text)
    plain = _YAML_COMMENT.sub("", text.translate(_ODD))
    return _read_surely(plain, _load_yaml)


def _load_yaml(text: str) -> object:
    """Load YAML of plain values.

    Raises:
        ValueError: it has tags or references, or is no YAML.
    """
    try:
        for event in yaml.parse(text, yaml.SafeLoader):
            if getattr(event, "anchor", None) or getattr(event, "tag", None):
                raise ValueError("it has tags or references")

        return yaml.safe_load(text)
    except _YAML_ERRORS as error:
        raise ValueError("it is no YAML") from error


def closing(text: str, start: int, most: int) -> int | None:
    """Return where the object that begins at ``start`` ends, by its braces; None: not within ``most`` characters.

    Where quotes can't be trusted, braces in them count, too.
    """
    for pattern in (_BRACE, re.compile("([{}])")):
        depth = 0
        for found in pattern.finditer(text, start, start + most):
            depth += {"{": 1, "}": -1, None: 0}[found[1]]
            if depth == 0:
                return found.end()

    return None


def _refuse_large(text: str) -> None:
    """Refuse what is too long, or has too many brackets open at a time, whatever stands in quotes.

    Raises:
        DesignError: it is.
    """
    depth = 0
    most = 0
    for bracket in re.finditer(r"[\[{}\]]", text):
        depth += 1 if bracket[0] in "[{" else -1
        most = max(most, depth)

    if len(text) > MAX_MENDED or most > MAX_OPEN:
        raise DesignError("it is malformed, and too long or too deep to be mended")


def _is_nested(text: str) -> bool:
    """Report whether brackets say what is whose: none is too many, and only one ``]`` before a ``}`` may be missing."""
    stack: list[str] = []
    before = ":"
    outside = _QUOTED.sub("", text)
    if _JUNK.search(outside):
        return False

    for mark in re.findall(r"[\[{}\],:]", outside):
        if mark in "[{":
            if stack and stack[-1] == "{" and before != ":":
                return False
            stack.append(mark)

        if mark == "}" and stack[-1:] == ["["]:
            stack.pop()
        if mark in "]}" and (not stack or stack.pop() != _OPENS[mark]):
            return False

        before = mark

    return not stack


def _straighten(match: re.Match[str]) -> str:
    """Keep a text in JSON's quotes; write one in curly quotes, or a curly quote that stands alone, in JSON's."""
    if match[2] is not None:
        return _write_text(match[2])

    return match[1] or '"'


def _write_text(inside: str) -> str:
    """Put a text in JSON's quotes; those inside may be escaped already."""
    escaped = re.sub(r'(?<!\\)"', r"\\" + '"', inside)
    return f'"{escaped}"'


def _compute(match: re.Match[str]) -> str:
    """Keep a text in quotes; replace what stands bare as a value: a sum by its number, what has a unit by a text.

    Raises:
        DesignError: it may be one number or two.
    """
    bare = (match[3] or "").strip()
    if is_uneven(bare):
        raise DesignError(
            f"{shorten(bare)} may be one number or two; write the number itself"
        )
    if bare == "…":
        bare = ELLIPSIS
    if bare == ELLIPSIS or has_unit(bare):
        return f"{match[2]}{json.dumps(bare)}"

    value = read_figure(bare, {})
    if value is None or _JSON_NUMBER.fullmatch(bare):
        return match[0]

    return f"{match[2]}{value!r}"


def _read_surely(text: str, read: Callable[[str], Any]) -> object:
    """Read a text, and refuse what has other numbers than the text.

    Raises:
        DesignError: it has, or it can't be read.
    """
    try:
        value: object = read(text)
        written = json.dumps(value, ensure_ascii=False, default=str)
    except (ValueError, RecursionError) as error:
        raise DesignError("it is malformed, and can't be mended") from error

    spelled = _CODE.sub(lambda code: chr(int(code[1], 16)), text)
    if figures_in(written) != figures_in(spelled):
        raise DesignError("it is malformed, and its numbers can't be read for certain")

    return value

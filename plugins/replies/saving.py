"""Find the designs document in a model's reply, whole or malformed, and save what is sound in it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import islice
from typing import Any

from core.design import DesignError
from core.designs.replies import EXPECTED, Unread
from plugins.replies.answer_bodies import join_texts
from plugins.replies.assumptions import assume
from plugins.replies.decoding import Malformed, decode
from plugins.replies.envelopes import (
    NAMES,
    find_designs,
    is_design,
    plain_name,
)
from plugins.replies.mending import MAX_MENDED, closing, mend_json, read_yaml

MAX_SAVED = 1000
"""The most designs that stand alone that are read."""

MAX_ALL_MENDED = 200_000
"""The most characters of a reply that are looked at to be mended, which takes time."""

MAX_WORK = 2_000_000_000
"""The most work on objects that turn out to be malformed, of which one may hold others; some seconds."""

_READING = 100
"""To read a character is so much more work than to count lines."""

MENDED = "malformed JSON, or YAML, is read where its numbers are certain"

THOUGHT = "a draft in what a model thought before its answer is left out"

UNCLOSED = "a malformed list of designs is read design by design"

MAX_BLOCKS = 3
"""The most fenced blocks of a reply that are read in other ways."""

BLOCK = "```"
"""The key of a block of another language that stands beside a design, for the one text that it lacks."""

_THOUGHT = re.compile(r"<(think(?:ing)?)>.*?</\1>", re.DOTALL)
# Of OpenAI's harmony format: https://cookbook.openai.com/articles/openai-harmony
_ANALYSIS = re.compile(
    r"<\|channel\|>analysis<\|message\|>.*?(?=<\|(?:end|start|channel)\|>|\Z)",
    re.DOTALL,
)
# An underscore or another sign that Markdown escapes, which JSON does not.
_MARKDOWN = re.compile(r"(?<!\\)((?:\\\\)*)\\([_*#~<>.!+()\[\]-])")
_PLACEHOLDER = re.compile(
    r"\.{3}|…|<[^<>]*>|\{\{?[^{}]*\}?\}|string|str|text|name|(?:strategy|tool)_name",
    re.IGNORECASE,
)
_FENCE = re.compile(r"```\w*[^\n]{0,100}\n(.*?)(?:\n[ \t]*```|\Z)", re.DOTALL)
_LIST = re.compile(r"strategies\W{0,3}:\s*\[")
_GAP = r"(?:\s++|//[^\n]{0,300}+|/\*.{0,300}?\*/|#[^\n]{0,300}+){0,20}+"
_KEY = re.compile(rf"""\{{{_GAP}["'“”„«‘]?(\w+)["'”“»’]?\s*:""", re.DOTALL)
_YAML = re.compile(r"^(?:- )?[ \t]*(?:strateg|tool|action)\w*[ \t]*:", re.MULTILINE)
# Where a list of designs is cut off before the first key of its next one.
_CUT = re.compile(r"""\},\s*(?:\{\s*["'“]?\w*)?\Z""")


@dataclass(frozen=True)
class _Found:
    """An object of a reply, or the `Unread` in its place; its first key, and whether it lies in a malformed one."""

    value: Any
    key: str
    is_inner: bool


def read_reply(text: str) -> dict[str, list[Any]]:
    """Find the designs in a model's reply, with or without text around them, as a designs document.

    They are those of all documents that have some (`find_designs`): the last one's first, since it may correct the
    others. Designs that stand alone are joined, and what only shows the form of an answer is left aside. The reply
    may be the body of a server's answer.
    ``NaN`` and ``Infinity`` are read as strings. If the document is malformed, its designs are mended one by one,
    and an `Unread` replaces each that is cut off or can't be mended.

    Raises:
        DesignError: there is no design, or the document is malformed and has no sound one; gives line and column.
    """
    text = _MARKDOWN.sub(r"\1\2", text)
    said = _without_thoughts(text)
    if said != text:
        designs = _find_in(said)
        if designs:
            if text.count("{") > said.count("{"):
                assume(THOUGHT)

            return {"strategies": _with_blocks(designs, said)}

    found, longest = _find_objects(text)
    designs = _join_documents(found) or _read_otherwise(text)
    if designs:
        return {"strategies": _with_blocks(designs, text)}

    body = _MARKDOWN.sub(r"\1\2", join_texts(item.value for item in found))
    if "{" in body:
        designs = _find_in(body)
        if designs:
            return {"strategies": _with_blocks(designs, body)}

    if longest is not None:
        raise longest
    if not found:
        raise DesignError(f"the reply has no JSON object; {EXPECTED}")
    if "strategies" in found[0].value:
        raise DesignError(f"'strategies' is empty, or no list of objects; {EXPECTED}")

    named = ", ".join(str(key)[:40] for key in islice(found[0].value, 5))
    raise DesignError(f"the reply has no designs (its JSON has {named}); {EXPECTED}")


def _without_thoughts(text: str) -> str:
    """Leave out what a model thought aloud, in tags or in a channel of its own, before its answer."""
    said = _ANALYSIS.sub("", _THOUGHT.sub("", text))
    return said.rpartition("</think>")[2]


def _find_in(text: str) -> list[Any]:
    """Find the designs in a text; empty: none."""
    found, _ = _find_objects(text)
    return _join_documents(found) or _read_otherwise(text)


def _find_objects(text: str) -> tuple[list[_Found], Malformed | None]:
    """Read the outermost objects of a text, and those in malformed ones; return the failure that got farthest, too."""
    found: list[_Found] = []
    longest: Malformed | None = None
    reached = -1
    left = MAX_ALL_MENDED
    broken_end = 0
    end = 0
    work = 0
    is_list_broken = False
    while work < MAX_WORK:
        start = text.find("{", end)
        if start < 0:
            break

        value: object
        is_inner = start < broken_end
        try:
            value, end = decode(text, start, "the reply")
        except Malformed as error:
            # It was read up to there, and all lines before it were counted.
            work += error.end + _READING * (error.end - start)
            if error.end - start > reached:
                longest = error
                reached = error.end - start

            value, end = _mend(text, start, left)
            left -= end - start
            if isinstance(value, dict):
                assume(MENDED)
            is_list_broken = is_list_broken or value is None

        if isinstance(value, Unread):
            broken_end = max(broken_end, end)
        if not isinstance(value, dict):
            end = start + 1

        key = _KEY.match(text, start)
        found.append(_Found(value, plain_name(key[1]) if key else "", is_inner))

    is_list_whole = any(
        isinstance(item.value, dict) and "strategies" in item.value for item in found
    )
    has_read = any(item.value is not None for item in found)
    if has_read and is_list_broken and not is_list_whole:
        assume(UNCLOSED)
    if longest is not None and _CUT.search(text, len(text) - 100):
        found.append(_Found(_unread(text, end), "strategyname", False))

    return found, longest


def _mend(text: str, start: int, most: int) -> tuple[object, int]:
    """Mend the design that begins at ``start``; return it, and how far at most ``most`` characters were looked at.

    None replaces a document with a list of designs, which are mended one by one.
    """
    most = max(0, min(most, MAX_MENDED))
    closed = closing(text, start, most)
    end = closed or min(start + most, len(text))
    if _LIST.search(text, start, end):
        return None, end
    if closed is None:
        return _unread(text, start), end

    try:
        return mend_json(text[start:end]), end
    except DesignError as error:
        return _unread(text, start, f": {error}"), end


def _unread(text: str, start: int, reason: str = "") -> Unread:
    """Say that the design that begins at ``start`` can't be read."""
    line = text.count("\n", 0, start) + 1
    place = f"it begins at line {line} of the reply"
    return Unread(f"the design is cut off or malformed ({place}){reason}")


def _join_documents(found: list[_Found]) -> list[Any]:
    """Join the designs of all documents, the last one's first, and of those that stand alone, if one is sound.

    What lies in a malformed one, such as a component, is a design only if it begins like one.
    """
    documents: list[list[Any]] = []
    alone: list[Any] = []
    for item in found:
        value = item.value
        is_broken = isinstance(value, Unread) and (
            item.key in NAMES or (item.key != "" and not item.is_inner)
        )
        if is_broken or is_design(value):
            if not alone:
                documents.append(alone)
            alone.append(value)
        elif designs := find_designs(value):
            documents.append(designs)

    if alone and all(isinstance(design, Unread) for design in alone):
        documents = [document for document in documents if document is not alone]
    if len(documents) > 1:
        assume("designs of all documents of an answer are read, the last one's first")

    joined: list[Any] = []
    for document in (*documents[-1:], *documents[:-1]):
        left = MAX_SAVED - len(joined)
        joined += [item for item in document[:left] if item not in joined]

    return [design for design in joined if not _is_form(design)]


def _is_form(design: object) -> bool:
    """Report whether a design only shows how one is written: its names are placeholders."""
    if not isinstance(design, dict):
        return False

    names = [
        str(value).strip()
        for key, value in design.items()
        if plain_name(key) in ("strategyname", "toolname")
    ]
    return bool(names) and all(map(_PLACEHOLDER.fullmatch, names))


def _read_otherwise(text: str) -> list[Any]:
    """Read what no design begins in as usual: JSON with its quotes escaped, malformed JSON of another order, YAML."""
    blocks = [match[1] for match in _FENCE.finditer(text)][:MAX_BLOCKS]
    for piece in (*blocks, text):
        for read in (_read_escaped, _read_mended, _read_yaml):
            try:
                designs = find_designs(read(piece))
            except DesignError:
                continue

            if any(isinstance(design, dict) for design in designs):
                assume(MENDED)
                return designs

    return []


def _read_escaped(text: str) -> object:
    """Read JSON whose quotes are escaped, as the inside of a string."""
    start = text.find("{")
    inside = text[start : text.rfind("}") + 1]
    return decode(f'"{inside}"', 0, "the reply")[0]


def _read_mended(text: str) -> object:
    """Mend the first object of a text."""
    first = _KEY.search(text)
    start = first.start() if first else len(text)
    return mend_json(text[start : closing(text, start, MAX_MENDED) or start])


def _read_yaml(text: str) -> object:
    """Read YAML from its first key on."""
    first = _YAML.search(text)
    return read_yaml(text[first.start() if first else len(text) :])


def _with_blocks(designs: list[Any], text: str) -> list[Any]:
    """Add to each design the block of XML beside it, if there are as many blocks as designs."""
    blocks = [match[1] for match in _FENCE.finditer(text)]
    blocks = [block for block in blocks if block.lstrip().startswith("<")]
    if len(blocks) != len(designs):
        return designs

    return [
        {**design, BLOCK: block} if isinstance(design, dict) else design
        for design, block in zip(designs, blocks, strict=True)
    ]

"""How a model is asked: what its server refuses by name is said in the next weaker way, or left out."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

Form = Literal["json_schema", "json_object", "text"]
Length = Literal["max_tokens", "max_completion_tokens", ""]


@dataclass(frozen=True)
class Manner:
    """What a request to a model holds beside its text.

    Attributes:
        form: how the answer is held to its JSON schema: by the schema itself, as JSON alone, or by the prompt's text.
        length: the name of the limit of an answer's length; empty: none is sent.
        seed: it has a seed.
        temperature: it has a temperature.
        thinking: it says how much the model is to think.
        pictures: it has the pictures.
        sheets: so many pictures it has at most, on which all others are drawn; 0: any number.
        marks: its shared beginning is marked, for a provider that keeps what is marked.
        usage: a stream is asked to end with the numbers of tokens.
        stream: the answer is to come as a stream.
    """

    form: Form = "json_schema"
    length: Length = "max_tokens"
    seed: bool = True
    temperature: bool = True
    thinking: bool = True
    pictures: bool = True
    sheets: int = 0
    marks: bool = False
    usage: bool = True
    stream: bool = True


@dataclass(frozen=True)
class _Refusable:
    """A field of `Manner` that servers may refuse.

    Attributes:
        names: how they name it, as a pattern.
        weaker: what it is from then on, one after the other, each with the words that say so.
    """

    names: str
    weaker: tuple[tuple[Any, str], ...]


def _left_out(names: str, words: str) -> _Refusable:
    """Make a field that is left out when it is refused."""
    return _Refusable(names, ((False, words),))


# The first name that an error has counts.
_FIELDS: Mapping[str, _Refusable] = {
    "form": _Refusable(
        r"response.?format|json.?schema|json.?object|output.?format|structured.output|guided|grammar|\bschema\b"
        r"|too many states",
        (
            (
                "json_object",
                "no response_format json_schema: from now on json_object, and the schema in the prompt's text",
            ),
            (
                "text",
                "no response_format json_object: from now on the JSON schema is in the prompt's text alone",
            ),
        ),
    ),
    "usage": _left_out(
        r"stream_options|include_usage", "no stream_options: tokens are counted here"
    ),
    "seed": _left_out(r"\bseed\b", "no seed: it is left out"),
    "temperature": _left_out(r"\btemperature\b", "no temperature: it is left out"),
    "thinking": _left_out(
        r"reasoning.?effort|\bthinking|\breasoning\b", "no vlm.thinking: it is left out"
    ),
    "length": _Refusable(
        r"max_tokens|max_completion_tokens|max_?output_?tokens",
        (
            (
                "max_completion_tokens",
                "no max_tokens: from now on max_completion_tokens",
            ),
            (
                "",
                "no limit of an answer's length: vlm.max_output_tokens is left out",
            ),
        ),
    ),
    "marks": _left_out(
        r"cache_control", "no marks for what it may keep: they are left out"
    ),
    "pictures": _left_out(
        r"\bimages?\b|image_url|\bvision\b|multi.?modal|mmproj|content\S*: input should be a valid string"
        r"|content must be a string",
        "no pictures: they are left out, and the prompt's text says so; a model that sees designs better, "
        "and prompt.context=words prompt.picture=false is made for one that doesn't",
    ),
    "stream": _left_out(
        r"\bstream(ing|ed)?\b",
        "no streams: from now on answers come whole, within vlm.timeout_s",
    ),
}
_PATTERN = re.compile(
    "|".join(f"(?P<{name}>{field.names})" for name, field in _FIELDS.items()),
    re.IGNORECASE,
)

# Words by which a server says that the request itself is wrong, also with the status of a failure of its own.
_REFUSES = re.compile(
    r"not supported|unsupported|n[o']t support|input should be|validation error|unrecognized|extra inputs"
    r"|unknown (field|parameter|argument|name)|unexpected (endpoint|keyword|argument)|must be (a|one)\b|not permitted"
    r"|not allowed|exceed\w* (the )?(available )?context|context (length|window|size)"
    r"|missing data required for image input",
    re.IGNORECASE,
)
# "At most 1 image(s) may be provided in one request.", in vLLM's words.
_MOST_PICTURES = re.compile(
    r"(?:at most|up to|more than|maximum(?: of| is)?|limit(?: of| is)?)\s+(\d+)\s+(?:image|picture)",
    re.IGNORECASE,
)
_LONGEST = 3000  # characters of an error that are looked at


def says_no(words: str) -> bool:
    """Say if a server's words refuse the request itself, so that sending it again would come to the same."""
    return _REFUSES.search(words[:_LONGEST]) is not None


def weaken(manner: Manner, words: str) -> tuple[Manner, str] | None:
    """Return the next weaker manner than the one that a server refused, and what changes; None: it named nothing.

    Args:
        manner: of the request that was refused.
        words: of the server.
    """
    fewer = _MOST_PICTURES.search(words[:_LONGEST])
    most = int(fewer[1]) if fewer else 0
    if most and manner.pictures and (manner.sheets == 0 or most < manner.sheets):
        said = f"at most {most} pictures: the others are drawn on the same sheet"
        return replace(manner, sheets=most), said

    for found in _PATTERN.finditer(words[:_LONGEST]):
        name = found.lastgroup or ""
        now = getattr(manner, name)
        ways = dict(_FIELDS[name].weaker)
        left = [*ways]
        if now in ways:
            left = left[left.index(now) + 1 :]
        if left:
            changed = {name: left[0]}
            return replace(manner, **changed), ways[left[0]]

    return None

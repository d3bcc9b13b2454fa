"""How a model is asked: what its server refuses by name is said in the next weaker way, or left out."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Literal

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
    marks: bool = False
    usage: bool = True
    stream: bool = True


# By the field of `Manner`: how servers name it. The first name that an error has counts.
_NAMES = {
    "form": r"response.?format|json.?schema|json.?object|output.?format|structured.output|guided|grammar|\bschema\b"
    r"|too many states",
    "usage": r"stream_options|include_usage",
    "seed": r"\bseed\b",
    "temperature": r"\btemperature\b",
    "thinking": r"reasoning.?effort|\bthinking|\breasoning\b",
    "length": r"max_tokens|max_completion_tokens|max_?output_?tokens",
    "marks": r"cache_control",
    "pictures": r"\bimages?\b|image_url|\bvision\b|multi.?modal|mmproj|content\S*: input should be a valid string"
    r"|content must be a string",
    "stream": r"\bstream(ing|ed)?\b",
}
_PATTERN = re.compile(
    "|".join(f"(?P<{name}>{words})" for name, words in _NAMES.items()), re.IGNORECASE
)

# Words by which a server says that the request itself is wrong, also with the status of a failure of its own.
_REFUSES = re.compile(
    r"not supported|unsupported|n[o']t support|input should be|validation error|unrecognized|extra inputs"
    r"|unknown (field|parameter|argument|name)|unexpected (endpoint|keyword|argument)|must be (a|one)\b|not permitted"
    r"|not allowed|exceed\w* (the )?(available )?context|context (length|window|size)",
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
    for found in _PATTERN.finditer(words[:_LONGEST]):
        name = found.lastgroup or ""
        step = _step(manner, name)
        if step is not None:
            return step

    return None


def _step(manner: Manner, name: str) -> tuple[Manner, str] | None:
    """Take one field of a manner a step down, and say what changes; None: there is no step left."""
    if name == "form":
        if manner.form == "json_schema":
            line = "no response_format json_schema: from now on json_object, and the schema in the prompt's text"
            return replace(manner, form="json_object"), line
        if manner.form == "json_object":
            line = "no response_format json_object: from now on the JSON schema is in the prompt's text alone"
            return replace(manner, form="text"), line
        return None

    if name == "length":
        if manner.length == "max_tokens":
            line = "no max_tokens: from now on max_completion_tokens"
            return replace(manner, length="max_completion_tokens"), line
        if manner.length:
            line = "no limit of an answer's length: vlm.max_output_tokens is left out"
            return replace(manner, length=""), line
        return None

    if not getattr(manner, name, False):
        return None

    lines = {
        "seed": "no seed: it is left out",
        "temperature": "no temperature: it is left out",
        "thinking": "no vlm.thinking: it is left out",
        "pictures": "no pictures: they are left out, and the prompt's text says so",
        "marks": "no marks for what it may keep: they are left out",
        "usage": "no stream_options: tokens are counted here",
        "stream": "no streams: from now on answers come whole, within vlm.timeout_s",
    }
    changed = {name: False}
    return replace(manner, **changed), lines[name]  # type: ignore[arg-type]

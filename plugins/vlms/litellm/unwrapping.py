"""Bring answers into the form that LiteLLM reads, wherever their text stands: what is paid for is kept.

Errors keep the server's own words, wherever these stand.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

FAILED = 502  # the status of an error that comes with the status of a success, and names no other
_LONGEST_REFUSAL = 300
_LONGEST_WORDS = 3000  # of an error
_DEEPEST = 6  # errors within errors

# What servers say, without a status of their own, where nothing answers or where the request is wrong.
_NO_PLACE = re.compile(r"unexpected endpoint|unknown (endpoint|url|path)|not found")
_WRONG = re.compile(r"invalid_request|validation|unsupported|not supported|exceed")


def is_stream(beginning: bytes) -> bool:
    """Say if an answer's first bytes are those of a stream of events."""
    return beginning.lstrip().startswith((b"data:", b"event:", b":"))


def unwrap(content: bytes) -> tuple[int, bytes]:
    """Return the status and the content of a whole answer that came with status 200.

    An answer of OpenAI's protocol gets one message with its text, which may stand in parts, in the arguments of a tool
    call, or in what the model thought. An error without a text gets its own status, and keeps the provider's words.

    Args:
        content: the body of an answer, unpacked.
    """
    document = _load(content)
    if not isinstance(document, dict):
        return 200, content

    choice = _first(document.get("choices"))
    message = choice.get("message")
    error = document.get("error") or choice.get("error")
    text = find_text(message) if isinstance(message, dict) else ""

    if error and not text:
        return _find_status(error), _write_error(error)

    if not isinstance(message, dict):
        return 200, content

    plain = {"role": "assistant", "content": text or None}
    refusal = message.get("refusal")

    if isinstance(refusal, str):
        plain["refusal"] = refusal[:_LONGEST_REFUSAL]

    finish = choice.get("finish_reason")
    if finish in (None, "tool_calls", "function_call"):
        finish = "stop"

    document["choices"] = [{"index": 0, "finish_reason": finish, "message": plain}]

    return 200, json.dumps(document).encode()


def unwrap_error(content: bytes) -> bytes:
    """Return an error's content with the words of the server that it passes on, or that stand where LiteLLM looks not.

    Args:
        content: the body of an answer with the status of an error.
    """
    document = _load(content)
    if not isinstance(document, dict):
        return content

    error = document.get("error", document)
    is_plain = isinstance(error, dict) and isinstance(error.get("message"), str)
    if is_plain and "metadata" not in error:
        return content

    return _write_error(error)


def unwrap_event(line: bytes) -> bytes:
    """Return a line of a stream with the text of OpenAI's protocol as one text, and an error in its usual form.

    Args:
        line: without its end; one that is no event of that protocol stays as it is.
    """
    if not line.startswith(b"data:"):
        return line

    document = _load(line.removeprefix(b"data:"))
    if not isinstance(document, dict):
        return line

    error = document.get("error")
    if error and not isinstance(error, dict):
        return b"data: " + _write_error(error)

    delta = _first(document.get("choices")).get("delta")
    if not isinstance(delta, dict):
        return line

    for name in ("images", "annotations", "audio"):
        delta.pop(name, None)
    if isinstance(delta.get("content"), list):
        delta["content"] = _join(delta["content"])

    return b"data: " + json.dumps(document).encode()


def find_text(message: Mapping[str, Any]) -> str:
    """Return the text of a message: its content, a tool call's arguments, or else what holds JSON in its thoughts.

    Arguments of a tool call follow a content without JSON, such as a sentence that announces them.

    Args:
        message: of OpenAI's protocol, with fields of any type.
    """
    content = _join(message.get("content"))
    if "{" in content:
        return content

    arguments = _find_arguments(message)
    if arguments:
        return f"{content}\n\n{arguments}" if content.strip() else arguments

    if content.strip():
        return content

    for name in ("reasoning_content", "reasoning"):
        thought = _join(message.get(name))
        if "{" in thought:
            return thought

    return ""


def _find_arguments(message: Mapping[str, Any]) -> str:
    """Return the arguments of a message's first tool call that has some; empty: none has."""
    calls = message.get("tool_calls")
    functions = [call.get("function") for call in calls or () if isinstance(call, dict)]
    functions.append(message.get("function_call"))

    for function in functions:
        if isinstance(function, dict) and function.get("arguments"):
            arguments = function["arguments"]
            return arguments if isinstance(arguments, str) else json.dumps(arguments)

    return ""


def find_words(error: object, depth: int = 0) -> str:
    """Return what an error says, with the words of the server behind a gateway.

    Args:
        error: a text, which may be JSON, or a document of any form.
        depth: how many errors it stands within.
    """
    if depth > _DEEPEST:
        return ""
    if isinstance(error, str):
        document = _load(error.encode("utf-8", "replace"))
        is_document = isinstance(document, dict | list)
        return find_words(document, depth + 1) if is_document else error
    if isinstance(error, list):
        said = [find_words(part, depth + 1) for part in error]
        return "; ".join(words for words in said if words)
    if not isinstance(error, dict):
        return ""

    place = error.get("loc")  # of FastAPI's and Pydantic's errors
    named = ".".join(map(str, place)) if isinstance(place, list) else ""
    said = [named]
    for name in ("message", "msg", "detail", "error", "metadata", "raw"):
        said.append(find_words(error.get(name), depth + 1))

    return ": ".join(dict.fromkeys(words for words in said if words))


def _write_error(error: object) -> bytes:
    """Write an error in the usual form, with all its words in one message."""
    message = find_words(error)[:_LONGEST_WORDS] or json.dumps(error)
    kept: dict[str, Any] = {"message": message}

    if isinstance(error, dict):
        for name in ("type", "param", "code"):
            kept[name] = error.get(name)

    return json.dumps({"error": kept}).encode()


def _find_status(error: object) -> int:
    """Return the status of an error that came with that of a success."""
    code = error.get("code") if isinstance(error, dict) else None
    if str(code).isdigit() and 400 <= int(str(code)) < 600:
        return int(str(code))

    words = f"{find_words(error)} {json.dumps(error)}".lower()
    if _NO_PLACE.search(words):
        return 404
    if _WRONG.search(words):
        return 400

    return FAILED


def _load(content: bytes) -> object:
    """Read JSON; None: it is none."""
    try:
        return json.loads(content)
    except (ValueError, RecursionError):
        return None


def _join(content: object) -> str:
    """Join the texts of a message's parts; a text is one.

    Args:
        content: of a message: a text, a list of parts, or anything.
    """
    if isinstance(content, str):
        return content
    if not isinstance(content, list):
        return ""

    texts = [part.get("text") for part in content if isinstance(part, dict)]

    return "".join(text for text in texts if isinstance(text, str))


def _first(choices: object) -> dict[str, Any]:
    """Return the first of an answer's choices; empty: there is none."""
    if isinstance(choices, list) and choices and isinstance(choices[0], dict):
        return choices[0]

    return {}

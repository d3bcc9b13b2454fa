"""Bring answers into the form that LiteLLM reads, wherever their text stands: what is paid for is kept."""

from __future__ import annotations

import json
from typing import Any

FAILED = 502  # the status of an error that comes with the status of a success, and names no other
_LONGEST_REFUSAL = 300


def unwrap(content: bytes) -> tuple[int, bytes]:
    """Return the status and the content of an answer that came with status 200.

    An answer of OpenAI's protocol gets one message with its text, which may stand in parts, in the arguments of a tool
    call, or in what the model thought. An error without a text gets its own status, and keeps the provider's words.

    Args:
        content: the body of an answer, unpacked.
    """
    try:
        document = json.loads(content)
    except (ValueError, RecursionError):
        return 200, content

    if not isinstance(document, dict):
        return 200, content

    choice = _first(document.get("choices"))
    message = choice.get("message")
    error = document.get("error") or choice.get("error")
    text = find_text(message) if isinstance(message, dict) else ""

    if error and not text:
        code = error.get("code") if isinstance(error, dict) else None
        status = FAILED

        if isinstance(code, int) and 400 <= code < 600:
            status = code

        return status, json.dumps({"error": error}).encode()

    if not isinstance(message, dict) or message.get("content") == text:
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


def find_text(message: dict[str, Any]) -> str:
    """Return the text of a message: its content, a tool call's arguments, or else what holds JSON in its thoughts.

    Args:
        message: of OpenAI's protocol, with fields of any type.
    """
    content = _join(message.get("content"))
    if content.strip():
        return content

    calls = message.get("tool_calls")
    functions = [call.get("function") for call in calls or () if isinstance(call, dict)]
    functions.append(message.get("function_call"))

    for function in functions:
        if isinstance(function, dict) and function.get("arguments"):
            arguments = function["arguments"]
            return arguments if isinstance(arguments, str) else json.dumps(arguments)

    for name in ("reasoning_content", "reasoning"):
        thought = _join(message.get(name))
        if "{" in thought:
            return thought

    return ""


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

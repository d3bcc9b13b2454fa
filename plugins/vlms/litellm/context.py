"""Ask Ollama for a context that holds the prompt: of a longer one its server drops a part in silence."""

from __future__ import annotations

import logging
import os
import threading

import httpx

from core.interfaces import Picture, Request, Text

SMALLEST = 8192
"""Tokens: the smallest context that is asked for. It doubles from there, since each new size loads the model anew."""

ANSWER = 8192
"""Tokens that are kept for an answer whose length has no limit."""

MOST_CHARACTERS = 6.0
"""Characters of a prompt to a token, at most: English prose has some 4 to 5, numbers and URDF fewer."""

USUAL_CHARACTERS = 3.0
"""Characters of a prompt to a token, for one that is to fit for certain."""

PICTURE = 1200
"""Tokens of a picture of 640 x 480 pixels, at most."""

_SHOW_TIMEOUT_S = 10.0
_USUAL_SERVER = "http://localhost:11434"

_log = logging.getLogger(__name__)


class OllamaContext:
    """The size of the context that one model is asked for; it only grows.

    Args:
        model: its name, without provider.
        server: its address; None: Ollama's own default.
    """

    def __init__(self, model: str, server: str | None) -> None:
        self._model = model
        self._server = server or os.environ.get("OLLAMA_API_BASE") or _USUAL_SERVER
        self._lock = threading.Lock()
        self._size = 0
        self._most: int | None = None

    def fit(self, request: Request, answer: int | None) -> int:
        """Return the context for a request, in tokens, at most what the model was made for.

        Args:
            request: that is sent.
            answer: the limit of an answer, in tokens; None: there is none.
        """
        parts = [part for message in request.messages for part in message.parts]
        pictures = sum(isinstance(part, Picture) for part in parts)
        prompt = count_characters(request) / USUAL_CHARACTERS
        wanted = prompt + pictures * PICTURE + (answer or ANSWER)

        with self._lock:
            if not self._size:
                self._size = SMALLEST
                self._most = self._find_most()

            while self._size < wanted:
                self._size *= 2

            return min(self._size, self._most or self._size)

    def _find_most(self) -> int | None:
        """Ask the server for the longest context that the model was made for; None: it does not say."""
        try:
            answer = httpx.post(
                f"{self._server.rstrip('/')}/api/show",
                json={"model": self._model},
                timeout=_SHOW_TIMEOUT_S,
            )
            facts = answer.raise_for_status().json()["model_info"]
            sizes = [
                int(value)
                for name, value in facts.items()
                if name.endswith(".context_length")
            ]
        except (
            httpx.HTTPError,
            ValueError,
            LookupError,
            TypeError,
            AttributeError,
        ) as error:
            _log.info("%s: the model's context is unknown: %s", self._model, error)
            return None

        return min(sizes, default=None)


def count_characters(request: Request) -> int:
    """Count the characters of a request's texts."""
    parts = [part for message in request.messages for part in message.parts]
    return sum(len(part.text) for part in parts if isinstance(part, Text))


def find_miscount(request: Request, counted: int | None) -> str:
    """Say that a server counted far fewer tokens than a prompt has; empty: its count may be right.

    Args:
        request: that was sent.
        counted: tokens of the prompt, by the server; None: it does not say.
    """
    least = round(count_characters(request) / MOST_CHARACTERS)
    if counted is None or counted >= least:
        return ""

    return (
        f"the server counted {counted:,} tokens of a prompt that has at least {least:,}: it may have dropped the rest; "
        "give it a larger context"
    )

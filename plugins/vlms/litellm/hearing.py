"""Hear an answer while it arrives, and keep what came if it breaks off."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from types import ModuleType
from typing import Any

from plugins.vlms.litellm.transport import Life


class Hearing:
    """What came of one answer so far. It may be looked at while another thread adds to it.

    Attributes:
        life: when the server last gave a sign of life.
        chunks: parts of a stream, in LiteLLM's form.
        characters: of the answer and of the model's thoughts.
    """

    def __init__(
        self, silence_s: float, heard: Callable[[int], None] = lambda characters: None
    ) -> None:
        """Begin with nothing heard.

        Args:
            silence_s: the longest that a server may be silent.
            heard: called with the characters so far, whenever more arrive.
        """
        self.life = Life(silence_s)
        self.chunks: list[Any] = []
        self.characters = 0
        self._heard = heard

    def gather(self, litellm: ModuleType, stream: Iterable[Any]) -> Any:
        """Read a stream to its end, and return the whole answer in LiteLLM's form."""
        for chunk in stream:
            self.chunks.append(chunk)
            arrived = _count_characters(chunk)
            if arrived:
                self.characters += arrived
                self._heard(self.characters)

        return self.build(litellm)

    def build(self, litellm: ModuleType) -> Any:
        """Put together what came so far, as a whole answer in LiteLLM's form; None: nothing came."""
        return litellm.stream_chunk_builder(list(self.chunks))

    def reports_tokens(self) -> bool:
        """Say if the server told how many tokens there are; LiteLLM counts them where it does not."""
        return any(getattr(chunk, "usage", None) is not None for chunk in self.chunks)


def _count_characters(chunk: Any) -> int:
    """Count what a part of a stream adds to text, thoughts or a tool call's arguments."""
    choices = getattr(chunk, "choices", None)
    delta = getattr(choices[0], "delta", None) if choices else None
    texts = [getattr(delta, "content", None), getattr(delta, "reasoning_content", None)]

    for call in getattr(delta, "tool_calls", None) or ():
        texts.append(getattr(getattr(call, "function", None), "arguments", None))

    return sum(len(text) for text in texts if isinstance(text, str))

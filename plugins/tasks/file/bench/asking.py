"""Ask a model for a scene, as a run asks for designs: what was paid for is on disk before it is read."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from core.config.compose import part, tool_part
from core.errors import UsageError, UserError
from core.geometry import Array
from core.interfaces import VLM, Brief, Message, Request, Task
from core.plugins import ACTION, MODEL, event_hub
from core.plugins.blame import add_listener
from core.scene import Scene, State, floor, table
from core.search.model_requests import ask_model
from core.store.recorder import RunStore
from core.support.cli import say


class Bench(Task):
    """What is known of a bench before anybody looked: a table."""

    name = "Bench"
    description = "Nothing is known of this bench yet."
    goals = ()

    def scene(self, seed: int) -> Scene:
        return Scene((floor(), table()))

    def reward(self, start: State, end: State) -> Array:
        raise TypeError("nothing is wanted yet")


class Asker:
    """Asks a model, and keeps requests and replies in a folder as a run does.

    A request that has a reply there is not sent again: remove the folder to ask anew. ``vlm=replay`` takes it.
    """

    def __init__(self, vlm: VLM, brief: Brief, store: RunStore) -> None:
        self._vlm = vlm
        self._brief = brief
        self._replies = store.past.replies
        self._events = event_hub()
        self._events.register(store, "store")
        add_listener(self._events, vlm, "vlm")

    def ask(self, messages: Sequence[Message]) -> str:
        """Send messages, and return the text of the reply.

        Raises:
            UserError: the model gave no answer, or a limit of cost or tokens is reached.
        """
        content = hashlib.sha256(repr(messages).encode())
        name = f"scene-{content.hexdigest()[:8]}"
        request = Request(name, self._brief, tuple(messages), {}, 0.0, "scenes")
        if name not in self._replies:
            estimate = self._vlm.estimate(request, self._vlm.model)
            usd = estimate.usd_per_prompt_token
            cost = f" ({usd * estimate.prompt_tokens:.4f} USD)" if usd else ""
            tokens = f"{estimate.prompt_tokens} tokens{cost}, and the answer's"
            say(f"asking {self._vlm.model}: {tokens}")

        (reply,) = ask_model(self._vlm, [request], self._events, self._replies)
        if reply.error is not None:
            raise UserError(f"{self._vlm.model} gave no answer: {reply.error}")

        return reply.text


@contextmanager
def open_asker(cfg: DictConfig, folder: Path) -> Iterator[Asker]:
    """Open what asks the configured model; ``folder`` keeps requests and replies.

    Raises:
        UserError: the model can't be used, or has no eyes.
    """
    vlm = part(MODEL, cfg.vlm).create()
    if not (vlm.sees and vlm.criticises):
        raise UsageError(
            f"{vlm.model} has no eyes, and reads no sentence; choose a model with vlm=gemini or another one, or answer "
            "yourself with vlm=mailbox"
        )

    tools = tool_part(cfg).create()
    actions = part(ACTION, cfg.action).create()
    brief = Brief(Bench(), 0, tools, False, 0, 0, 0, 0, cfg.seed, actions=actions)
    config: Any = OmegaConf.to_container(cfg, resolve=True)
    store = RunStore.open(folder) or RunStore.create(folder, config)
    try:
        yield Asker(vlm, brief, store)
    finally:
        store.run_ended()

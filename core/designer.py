"""From a brief to candidates: compose the requests, ask the model, read its replies."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import pluggy

from core.design import Candidate, DesignError, Evaluation
from core.interfaces import VLM, Brief, Budget, Picture, Reply, Request, Task, ToolRepresentation
from core.prompts import Prompts, answer_schema
from core.reading import parse_reply, read_designs
from core.rules import SpawnRules

ToolKind = Literal["rigid", "gripper"]
TOOL_KINDS: tuple[ToolKind, ...] = get_args(ToolKind)


@dataclass
class Sampling:
    """How the model is sampled: an agent's temperature is drawn within ``spread`` of ``temperature``, clipped to [0,
    2].
    """

    temperature: float = 1.0
    spread: float = 0.5


class ModelDesigner:
    """The `core.interfaces.Designer`: agents without shared history, all asked at once.

    Agents' seeds, temperatures and kinds of tool follow from ``seed``, the generation and the agent's number alone.
    Of two ``tool_kinds`` each agent is given one by lot. Where the representation has a tool to give, agents are asked
    for plans only.
    """

    def __init__(
        self,
        task: Task,
        vlm: VLM,
        representation: ToolRepresentation,
        prompts: Prompts,
        budget: Budget,
        *,
        seed: int,
        sampling: Sampling,
        tool_kinds: Sequence[ToolKind],
        picture: Picture | None,
        events: pluggy.PluginManager,
    ) -> None:
        self.task = task
        self.vlm = vlm
        self.representation = representation
        self.prompts = prompts
        self.budget = budget
        self.seed = seed
        self.sampling = sampling
        self.tool_kinds = tuple(tool_kinds)
        self.picture = picture
        self.events = events
        self._spawn = SpawnRules(task, seed)
        self._given = representation.given(task)

    def design(self, generation: int, elites: Sequence[Evaluation] = ()) -> Iterator[Candidate]:
        requests = {r.id: r for r in (self._request(generation, agent, elites) for agent in range(self.budget.n_agent))}
        for request in requests.values():
            self.events.hook.request_composed(request=request)
        missing = set(requests)
        for reply in self._replies(requests):
            missing.discard(reply.request_id)
            yield from self._read(requests[reply.request_id], reply)
        for request_id in sorted(missing):
            yield self._lost(requests[request_id].brief, "no reply came")

    def _replies(self, requests: Mapping[str, Request]) -> Iterator[Reply]:
        """Replies as they arrive. Each is told to the listeners at once, so that it is on disk even if nobody comes
        to read it; for that they are listened for in a thread of their own, while candidates of earlier ones are
        tried.
        """
        arrived: queue.SimpleQueue[Reply | Exception | None] = queue.SimpleQueue()

        def listen() -> None:
            try:
                for reply in self.vlm.complete(list(requests.values())):
                    self.events.hook.reply_received(request=requests[reply.request_id], reply=reply)
                    arrived.put(reply)
            except Exception as error:  # to be raised where somebody sees it
                arrived.put(error)
            arrived.put(None)

        threading.Thread(target=listen, name="replies", daemon=True).start()
        while (reply := arrived.get()) is not None:
            if isinstance(reply, Exception):
                raise reply
            yield reply

    def _request(self, generation: int, agent: int, elites: Sequence[Evaluation]) -> Request:
        rng = np.random.default_rng([self.seed, generation, agent])
        kind = self.tool_kinds[int(rng.integers(len(self.tool_kinds)))]
        gripper = self._given.gripper if self._given is not None else kind == "gripper"
        temperature = self.sampling.temperature + rng.uniform(-self.sampling.spread, self.sampling.spread)
        brief = Brief(
            task=self.task,
            scene_seed=self.seed,
            representation=self.representation,
            gripper=gripper,
            n_tool=self.budget.n_tool if self._given is None else 1,
            n_action=self.budget.n_action,
            generation=generation,
            agent=agent,
            seed=int(rng.integers(2**31)),
            elites=tuple(elites),
        )
        messages = self.prompts.compose(brief, self.picture)
        schema = answer_schema(brief)
        return Request(f"g{generation}-a{agent}", brief, messages, schema, float(np.clip(temperature, 0.0, 2.0)))

    def _read(self, request: Request, reply: Reply) -> Iterator[Candidate]:
        """The candidates of a reply, no more than were asked for."""
        brief = request.brief
        if reply.error is not None:
            yield self._lost(brief, f"the model gave no answer: {reply.error}")
            return
        try:
            yield from read_designs(
                parse_reply(reply.text),
                self.representation,
                self._spawn,
                generation=brief.generation,
                agent=brief.agent,
                elites=tuple(elite.candidate.id for elite in brief.elites),
                n_tool=brief.n_tool,
                n_action=brief.n_action,
            )
        except DesignError as error:
            yield self._lost(brief, f"the reply can't be read: {error}")

    @staticmethod
    def _lost(brief: Brief, problem: str) -> Candidate:
        """Stands for all that an agent would have designed."""
        return Candidate(None, np.zeros((0, 6)), brief.generation, brief.agent, problem=problem)

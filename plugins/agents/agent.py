"""``vlm=agent``: answers a request with the designs that an agent tries, and tells the agent what comes of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from core.errors import UserError
from core.events import INTERRUPTED, Result, Run
from core.hooks import hookimpl
from core.interfaces import VLM, Evaluation, Reply, Request
from plugins.agents.bench import find_bench

ABSENT = "no agent is there: vlmgineer mcp task=NAME begins a run that one drives"


class Agent(VLM):
    """The agent that drives a run, as the model of ``evolution=agent``.

    A request is composed when the agent has brought designs, so that it is answered at once. Who drives is the reply's
    model.

    Attributes:
        run: what runs; None: nothing does yet.
        result: of the run; None: it has not ended.
        on_result: is called when the run has ended.
    """

    model = "agent"
    criticises = False

    def __init__(self) -> None:
        self.bench = find_bench()
        self.run: Run | None = None
        self.result: Result | None = None
        self.on_result: Callable[[], None] = lambda: None
        self._count = 0

    def complete(self, requests: Sequence[Request]) -> Iterator[Reply]:
        """See `VLM.complete`.

        Raises:
            UserError: it is asked by another strategy, or no agent is there.
        """
        if self.bench is None:
            raise UserError(ABSENT)
        designs = self.bench.designs
        if designs is None or len(requests) != 1:
            raise UserError("vlm=agent answers evolution=agent alone")

        (request,) = requests
        self.bench.designs = None
        name = self.bench.agent
        yield Reply(request.id, designs, f"agent ({name})" if name else "agent")

    @contextmanager
    def playing(self) -> Iterator[None]:
        """Let the bench know that something is played, which is interrupted when the agent leaves."""
        bench = self.bench
        assert bench is not None
        bench.is_trying = True
        try:
            yield
        finally:
            bench.is_trying = False

    @hookimpl
    def run_started(self, run: Run) -> None:
        self.run = run
        if self.bench is not None:
            self.bench.folder = run.folder

    @hookimpl
    def generation_started(self) -> None:
        self._count = 0
        self._say("trying")

    @hookimpl
    def candidate_evaluated(self, evaluation: Evaluation) -> None:
        self._count += 1
        self._say(f"{self._count} candidates tried, last {evaluation.candidate.id}")

    @hookimpl
    def run_finished(self, result: Result) -> None:
        self.result = result
        if self.bench is not None:
            self.bench.has_ended = result.stopped != INTERRUPTED
        self.on_result()

    def _say(self, doing: str) -> None:
        if self.bench is not None:
            self.bench.doing = doing

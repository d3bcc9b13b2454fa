"""``evolution=agent``: what an agent tries in one call is a generation, and there are as many as it makes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from core.design import Candidate
from core.errors import UsageError, UserError
from core.interfaces import Budget, EvolutionStrategy, Message, Request, Text
from core.search.designer import ModelDesigner
from core.trial import Evaluation
from plugins.agents.agent import ABSENT, Agent
from plugins.agents.bench_tools import Tools
from plugins.agents.session import Session

_LATER = (
    "The agent had what stands in the first request, and what its calls told it. This is its call of try_design "
    "number {}.\n"
)


class AgentSearch(EvolutionStrategy):
    """Waits for an agent's designs, and answers what it asks meanwhile.

    A call of ``try_design`` is a request with a reply, so that it is stored and resumed as any other. The budget is
    that of a search in generations: as many candidates in all, in calls of at most ``n_tool`` tools with ``n_action``
    plans each, and ``n_rollouts``.

    Args:
        designer: composes and reads; its model is `plugins.agents.agent.Agent`.
        budget: its limits.

    Raises:
        UserError: another model is asked, the task has several parts, or no agent is there and nothing was tried.
    """

    learns = False  # the agent is told by its calls

    def __init__(self, designer: ModelDesigner, budget: Budget) -> None:
        super().__init__(designer, budget)
        agent = getattr(designer, "vlm", None)
        if not isinstance(agent, Agent):
            raise UsageError("evolution=agent needs vlm=agent; vlmgineer mcp sets both")
        if len(designer.assignment.task.parts) > 1:
            raise UsageError("evolution=agent works on one task, without several parts")
        if designer.first_tools is not None:
            raise UsageError(
                "evolution=agent tries what its agent brings; leave tool.library away, and show the agent its tools"
            )
        if agent.bench is None and not designer.stored:
            raise UserError(ABSENT)

        self._bench = agent.bench
        self._session = Session(self, designer, agent)
        self._tools = Tools(self._session)
        agent.on_result = self._tell_result
        if self._bench is not None:
            self._bench.desk = self._tools

    # --- the search -----------------------------------------------------------------------------------------------

    def has_generation(self, generation: int, budget: Budget) -> bool:
        """Report whether the agent brings designs, once it has said so; those of an interrupted run are there.

        Raises:
            KeyboardInterrupt: the agent has left.
        """
        if f"g{generation}-a0" in self._session.asked.stored:
            return True
        if self._bench is None:
            return False
        self._tools.prepare()
        return self._bench.wait()

    def ask(self) -> Iterator[Candidate]:
        for answer in self._session.asked.ask([self._compose()]):
            yield from answer.candidates

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self._session.generation += 1
        self._session.tried += evaluations
        if self._bench is not None:
            self._bench.answer(lambda: self._tools.describe(evaluations))

    def _tell_result(self) -> None:
        if self._bench is not None:
            self._bench.answer(self._tools.describe_result)

    def _compose(self) -> Request:
        """Compose the request that the agent's call answers; the first holds all that it was told at the start."""
        session = self._session
        number = session.generation
        later = Message("user", (Text(_LATER.format(number + 1)),))
        messages: tuple[Message, ...] = (later,)
        if number == 0:
            messages = session.compose(session.brief())

        return Request(
            f"g{number}-a0",
            session.brief_reading(),
            messages,
            self._tools.schema,
            session.asked.sampling.temperature,
        )

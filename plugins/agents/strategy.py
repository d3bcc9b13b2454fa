"""``evolution=agent``: what an agent tries in one call is a generation, and there are as many as it makes."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

from core.design import Candidate
from core.errors import UsageError, UserError
from core.interfaces import Brief, Budget, EvolutionStrategy, Message, Request, Text
from core.search.assignment import Team
from core.search.designer import ModelDesigner
from core.trial import Evaluation, Trial, count_rollouts
from plugins.agents.agent import ABSENT, Agent
from plugins.agents.bench_tools import Tools

_ALONE = Team([0])
_SEARCHED = re.compile(r"g\d+-a0-")
"""The ids of candidates of the search; those that are tried beside it have other agents' numbers."""

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

        self.asked = designer
        self.agent = agent
        self.tried: list[Evaluation] = []
        self._generation = 0
        self._tools = Tools(self)
        agent.on_result = self._tell_result
        if agent.bench is not None:
            agent.bench.desk = self._tools

    # --- what is left ---------------------------------------------------------------------------------------------

    @property
    def most(self) -> int:
        """The candidates that the budget holds."""
        return self.budget.population * (self.budget.n_iteration + 1)

    @property
    def beside(self) -> list[Trial]:
        """What was tried beside the search, in some of its layouts or in another engine."""
        known = () if self.trials is None else self.trials.known.values()
        return [trial for trial in known if not _SEARCHED.match(trial.candidate)]

    @property
    def rollouts(self) -> int:
        """The rollouts that were played so far."""
        searched = sum(count_rollouts(e.candidate.id, e.trials) for e in self.tried)
        return searched + len(self.beside)

    @property
    def seconds(self) -> float:
        """How long the motions of these took."""
        played = [
            t for e in self.tried for t in e.trials if t.candidate == e.candidate.id
        ]
        lasted = [trial.figure("motion_s") for trial in [*played, *self.beside]]
        return math.fsum(motion_s for motion_s in lasted if math.isfinite(motion_s))

    def count_left(self, each: int, whole: int) -> int:
        """Count the tries that the budget still holds.

        Args:
            each: the rollouts that one takes.
            whole: those that a candidate of the search takes.
        """
        left = (self.most - len(self.tried)) * whole - len(self.beside)
        if self.budget.n_rollouts is not None:
            # One that was refused in the scene says where things are, as one that was played does.
            refused = sum(evaluation.status == "rejected" for evaluation in self.tried)
            left = min(left, self.budget.n_rollouts - self.rollouts - refused * whole)
        return max(left // each, 0)

    # --- the search -----------------------------------------------------------------------------------------------

    def has_generation(self, generation: int, budget: Budget) -> bool:
        """Report whether the agent brings designs, once it has said so; those of an interrupted run are there.

        Raises:
            KeyboardInterrupt: the agent has left.
        """
        if f"g{generation}-a0" in self.asked.stored:
            return True
        bench = self.agent.bench
        if bench is None:
            return False
        self._tools.prepare()
        return bench.wait()

    def ask(self) -> Iterator[Candidate]:
        for answer in self.asked.ask([self._compose()]):
            yield from answer.candidates

    def tell(self, evaluations: Sequence[Evaluation]) -> None:
        self._generation += 1
        self.tried += evaluations
        if self.agent.bench is not None:
            self.agent.bench.answer(lambda: self._tools.describe(evaluations))

    def _tell_result(self) -> None:
        if self.agent.bench is not None:
            self.agent.bench.answer(self._tools.describe_result)

    # --- requests ---------------------------------------------------------------------------------------------------

    def brief(self, *, gripper: bool | None = None) -> Brief:
        """Make the assignment that the agent is told: one tool with one plan.

        Args:
            gripper: ask for attachments to the fingers; None: what the task asks for first.
        """
        asked = self.asked
        brief, _ = asked.brief(0, 0, _ALONE, ())
        given = asked.assignment.given
        if given is not None:
            gripper = given.gripper
        elif gripper is None:
            gripper = asked.assignment.tool_kinds[0] == "gripper"

        return replace(brief, gripper=gripper, n_tool=1, n_action=1, alone=True)

    def compose(self, brief: Brief) -> tuple[Message, ...]:
        """Compose what a prompt would hold."""
        pictures = self.asked.pictures.get(brief.gripper, ())
        return self.asked.prompts.compose(brief, pictures)

    def brief_reading(self) -> Brief:
        """Make the assignment by which designs are read: as many as a call may hold, with parents of all tried."""
        brief = self.brief()
        budget = self.asked.assignment.budget
        return replace(
            brief,
            generation=self._generation,
            n_tool=budget.n_tool,
            n_action=budget.n_action,
            elites=tuple(self.tried),
        )

    def _compose(self) -> Request:
        """Compose the request that the agent's call answers; the first holds all that it was told at the start."""
        number = self._generation
        later = Message("user", (Text(_LATER.format(number + 1)),))
        messages: tuple[Message, ...] = (later,)
        if number == 0:
            messages = self.compose(self.brief())

        return Request(
            f"g{number}-a0",
            self.brief_reading(),
            messages,
            self._tools.schema,
            self.asked.sampling.temperature,
        )

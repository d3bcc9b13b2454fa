"""Define what all agents of a run are asked for, and teams of agents."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

from core.design import Candidate, Tool
from core.errors import UserError, choices
from core.interfaces import (
    ActionRepresentation,
    Budget,
    Designer,
    Evaluation,
    Robot,
    Task,
    ToolRepresentation,
)

TOOL_KINDS = ("rigid", "gripper")
DEFAULT_KINDS = ("rigid",)  # for a task that names none


@dataclass(frozen=True, eq=False)
class Assignment:
    """What all agents of a run are asked for: tools and plans for a task, in these forms.

    An agent's seed, temperature and kind of tool follow from ``seed``, the generation and the agent's number alone.

    Attributes:
        task: what tools and plans are for.
        representation: how tools are written; if it gives a tool itself, agents are asked for plans only.
        actions: how plans are written.
        budget: how many agents, tools and plans there are.
        seed: of the run.
        tool_kinds: some of `TOOL_KINDS`; each agent gets one of them at random.

    Raises:
        UserError: an unknown tool kind.

    For example::

        assignment = Assignment(task, representation, actions, budget, seed=3)
        designer = ModelDesigner(assignment, vlm, prompts, sampling, events)
    """

    task: Task
    representation: ToolRepresentation
    actions: ActionRepresentation
    budget: Budget
    seed: int
    tool_kinds: Sequence[str] = DEFAULT_KINDS

    def __post_init__(self) -> None:
        for name in self.tool_kinds:
            if name not in TOOL_KINDS:
                raise choices("tool kind", str(name), TOOL_KINDS, "task.tool_kinds")

    @cached_property
    def given(self) -> Tool | None:
        """The tool that the representation gives; None: agents design tools.

        Raises:
            UserError: there is no tool for this task, or it breaks a rule.
        """
        # Strategies import this module, and lists of plugins have no need of what checks tools.
        from core.designs.rules import given_tool

        return given_tool(self.representation, self.task)


@dataclass(frozen=True, eq=False)
class Team:
    """Agents that are shown the same elites, and nothing that other teams tried.

    Attributes:
        agents: their numbers, from 0; each is in one team.
        elites: what they are shown, the best first.
        warmth: added to the temperature of each.
        style: a text that stands in each prompt; empty: none.

    For example, two teams of three agents, of which one is to dare more::

        teams = [Team(range(3), elites), Team(range(3, 6), elites, warmth=0.3)]
        candidates = designer.design_in(generation, teams)
    """

    agents: Sequence[int]
    elites: Sequence[Evaluation] = ()
    warmth: float = 0.0
    style: str = ""


class AsksTeams(Designer, Protocol):
    """A designer that asks teams, as strategies with several populations need it.

    Attributes:
        assignment: what it asks them for.
    """

    assignment: Assignment

    def design_in(self, generation: int, teams: Sequence[Team]) -> Iterator[Candidate]:
        """Ask the agents of all teams at once, and yield their candidates as replies arrive; see `Designer.design`.

        Args:
            generation: its number, from 0.
            teams: no agent is in two of them.
        """


def borne_kinds(tool_kinds: Sequence[str], robot: Robot) -> list[str]:
    """Return the tool kinds that the robot can bear: without a gripper, rigid ones.

    Args:
        tool_kinds: what the user or the task asks for, some of `TOOL_KINDS`.
        robot: whose gripper, or flange, bears the tools.

    Raises:
        UserError: none is left.
    """
    if robot.gripper is not None:
        return list(tool_kinds)
    borne = [name for name in tool_kinds if name != "gripper"]
    if not borne:
        raise UserError(
            f"robot {robot.name} has no gripper, and task.tool_kinds has no other kind; set task.tool_kinds=[rigid], "
            "or choose another robot"
        )

    return borne

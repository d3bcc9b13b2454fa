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

    An agent's seed, temperature and kind of tool follow from ``seed``, the generation and the agent's number alone. Of
    two ``tool_kinds`` each agent gets one at random. Where the representation gives a tool, agents are asked for plans
    only.

    Raises:
        UserError: an unknown tool kind.
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
            UserError: there is no tool for this task.
        """
        return self.representation.given(self.task)


def borne_kinds(tool_kinds: Sequence[str], robot: Robot) -> list[str]:
    """Return the tool kinds that the robot can bear: without a gripper, rigid ones.

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


@dataclass(frozen=True, eq=False)
class Team:
    """Agents that are shown the same elites, and nothing that other teams tried.

    ``warmth`` is added to the temperature of each, and ``style``, a text, to its prompt.
    """

    agents: Sequence[int]
    elites: Sequence[Evaluation] = ()
    warmth: float = 0.0
    style: str = ""


class AsksTeams(Designer, Protocol):
    """A designer that asks teams; its ``assignment`` is what it asks them for."""

    assignment: Assignment

    def design_in(self, generation: int, teams: Sequence[Team]) -> Iterator[Candidate]:
        """Ask the agents of all teams at once, and yield their candidates as replies arrive (`Designer.design`)."""

"""Define teams of agents, which a strategy may ask in place of all agents alike."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from core.design import Candidate
from core.interfaces import Designer
from core.search.assignment import Assignment
from core.trial import Evaluation


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

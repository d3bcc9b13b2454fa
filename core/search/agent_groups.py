"""Define teams of agents, which a strategy may ask in place of all agents alike.

Covered by `tests/plugins/strategies/test_islands.py` and `tests/core/search/test_designer.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from core.design import Candidate, Evaluation
from core.errors import UsageError
from core.interfaces import VLM, Designer


@dataclass(frozen=True, eq=False)
class Team:
    """Agents that are shown the same elites, and nothing that other teams tried.

    ``warmth`` is added to the temperature of each, and ``style``, a text, to its prompt. ``member`` is the one of
    several models that answers them (`VLM.has_member`); empty: any.
    """

    agents: Sequence[int]
    elites: Sequence[Evaluation] = ()
    warmth: float = 0.0
    style: str = ""
    member: str = ""


def check_members(teams: Iterable[Team], vlm: VLM) -> None:
    """Check that the model has the members that teams ask for.

    Raises:
        UsageError: it has not.
    """
    for team in teams:
        if team.member and not vlm.has_member(team.member):
            raise UsageError(
                f"evolution.members: {vlm.model} has no member {team.member!r}; name members of several models "
                "(docs/models.md#several-models), or none"
            )


class AsksTeams(Designer, Protocol):
    """A designer that asks teams."""

    def design_in(self, generation: int, teams: Sequence[Team]) -> Iterator[Candidate]:
        """Ask the agents of all teams at once, and yield their candidates as replies arrive (`Designer.design`).

        Raises:
            UsageError: see `check_members`.
        """

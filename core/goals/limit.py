"""Define what must not happen, whichever goal is reached."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import ClassVar, NamedTuple

from core.goals.evidence import Evidence
from core.goals.goal import Goal
from core.goals.reaching import Reach
from core.scene import Scene


class Breach(NamedTuple):
    """What was done against a limit.

    Attributes:
        excess: how many times as much as is allowed; infinite where nothing is.
        time_s: when.
        text: what, in words.
    """

    excess: float
    time_s: float
    text: str


class Limit(Goal):
    """What must not happen, whichever goal is reached.

    Its share is what it leaves of the reward.

    Attributes:
        holds_untouched: whether it holds where nothing touches the things that it names.
    """

    holds_untouched: ClassVar[bool] = False

    def breaches(self, evidence: Evidence) -> Iterator[Breach]:
        """Yield what one world did against it, for observations."""
        return iter(())

    def allows_n(self, body: str) -> float | None:
        """Return the most force with which the robot may press a body, N; None: it says nothing of that."""
        return None

    def find_conflict(self, wanted: Reach, scene: Scene) -> str:
        """Say why it does not let a goal be reached; empty: it does."""
        return ""


def limits(goals: Iterable[Goal]) -> list[Limit]:
    """Return the goals that forbid something."""
    return [goal for goal in goals if isinstance(goal, Limit)]

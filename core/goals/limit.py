"""Define what must not happen, whichever goal is reached."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import ClassVar

from core.goals.evidence import Evidence
from core.goals.goal import Goal
from core.goals.reaching import Reach
from core.scene import Scene


class Limit(Goal):
    """What must not happen, whichever goal is reached.

    Its share is what it leaves of the reward.

    Attributes:
        holds_untouched: whether it holds where nothing touches the things that it names.
    """

    holds_untouched: ClassVar[bool] = False

    def breaches(self, evidence: Evidence) -> Iterator[tuple[float, str]]:
        """Yield what one world did against it, for observations: when, s, and what."""
        return iter(())

    def find_conflict(self, wanted: Reach, scene: Scene) -> str:
        """Say why it does not let a goal be reached; empty: it does."""
        return ""


def limits(goals: Iterable[Goal]) -> list[Limit]:
    """Return the goals that forbid something."""
    return [goal for goal in goals if isinstance(goal, Limit)]

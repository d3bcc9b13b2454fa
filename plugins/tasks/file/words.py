"""Describe goals, and the reward that follows from them, in plain words."""

from __future__ import annotations

from collections.abc import Sequence

from core.goals import KEPT_M, STRAYED_M
from core.scene import Goal
from core.support.templates import fill


def describe_goals(goals: Sequence[Goal], every: bool = False) -> list[str]:
    """Describe goals and the reward that `core.goals.goals_reward` makes of them, in lines."""
    given = {"goals": goals, "every": every, "kept": KEPT_M, "strayed": STRAYED_M}
    return fill("plugins.tasks.file", "goals", **given).splitlines()

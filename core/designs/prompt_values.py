"""Compute what the templates of prompts show, by the names that they use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from core.config.schemas import PromptSettings
from core.design import Tool
from core.designs.plan_rules import plan_limits
from core.interfaces import Brief, RolloutSettings
from core.plugins import installed
from core.task import NO_CONTEXT, Level
from core.trial import TIE


@dataclass(frozen=True)
class RunFacts:
    """What templates may say of a run, in each of its prompts.

    Attributes:
        settings: those of the prompts.
        rollout: how plans are executed.
        engine: the name of the one that executes them; empty: any.
        tie: see `core.trial.best_first`.
        decides: what decides between designs that earn alike, in words, the first thing first.
        judged: what a design is judged by; empty: the reward of one rollout.
        idea: a person's text, if templates quote it.
        criticised: whether the request is one for a critique.
    """

    settings: PromptSettings = field(default_factory=PromptSettings)
    rollout: RolloutSettings = field(default_factory=RolloutSettings)
    engine: str = ""
    tie: float = TIE
    decides: tuple[str, ...] = ("the most room to its limits", "the shortest way")
    judged: str = ""
    idea: str | None = None
    criticised: bool = False

    @cached_property
    def level(self) -> Level:
        """How much is told of a scene."""
        level: Level = installed().factory(
            "level", self.settings.context, "prompt.context"
        )()
        return level


PromptValue = Callable[[Brief, Tool, RunFacts], Any]
"""Computes what templates show under a name: of a brief, what is mounted, and the run."""


def prompt_values(facts: RunFacts, brief: Brief) -> dict[str, Any]:
    """Return the names that templates may use, and their values: those of plugins, and of core."""
    given = brief.representation.given(brief.task)
    mounted = given or Tool(gripper=brief.gripper)
    computed = installed().factories("prompt_value").items()
    return {
        **{name: compute(brief, mounted, facts) for name, compute in computed},
        **_assignment_values(facts, brief, given),
        **_scene_values(facts, brief, mounted),
    }


def _assignment_values(
    facts: RunFacts, brief: Brief, given: Tool | None
) -> dict[str, Any]:
    """What is asked for, of which kind, by which rules, and after what was tried before."""
    bare = given is not None and not given.components
    head = "tool"
    if bare:
        head = "gripper" if brief.gripper else "flange"
    return {
        "brief": brief,
        "given": given,
        "bare": bare,  # there is no tool at all
        "head": head,  # what acts
        "idea": facts.idea,
        "tool_rules": brief.representation.instructions(brief).strip(),
        "action_rules": brief.actions.instructions(brief).strip(),
        "judged": facts.judged.strip(),
        "tie": facts.tie,
        "decides": facts.decides,
        "feedback": facts.settings.feedback,
        "solved": any(
            elite.solved and elite.reward >= 1 - facts.tie for elite in brief.elites
        ),
        **plan_limits(),
    }


def _scene_values(facts: RunFacts, brief: Brief, mounted: Tool) -> dict[str, Any]:
    """The task and the arm, and how plans are executed."""
    task = brief.task
    return {
        "task": task,
        "context": facts.settings.context,
        "unseen": not facts.level.numbers,
        "robot": task.robot,
        "tool_friction": brief.representation.material.made(mounted).friction,
        "rollout": facts.rollout,
        "hold_s": max(facts.rollout.hold_s, task.hold_s),
        **NO_CONTEXT,
        **facts.level.values(task, brief.scene_seed),
    }

"""Compute what the templates of prompts show, by the names that they use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from core.config.schemas import PromptSettings
from core.design import Tool
from core.designs.elites import critiques_text, elites_text
from core.designs.feedback import generation_lines, last_generation
from core.designs.plan_rules import plan_limits
from core.interfaces import Brief, RolloutSettings
from core.plugins import installed
from core.robot.trajectory import plan_motion
from core.support.text import function_source, short_numbers
from core.task import NOTHING_TOLD, Level

PromptValue = Callable[[Brief, Tool, RolloutSettings, str], Any]
"""Computes what templates show under a name: of a brief, what is mounted, how plans are executed, and the engine."""


@dataclass(frozen=True)
class RunFacts:
    """What templates may say of a run, in each of its prompts.

    Attributes:
        settings: those of the prompts.
        level: how much is told of a scene.
        rollout: how plans are executed.
        engine: the name of the one that executes them; empty: any.
        tie: see `core.trial.ranked`.
        judged: what a design is judged by; empty: the reward of one rollout.
        idea: a person's text, if templates quote it.
    """

    settings: PromptSettings
    level: Level
    rollout: RolloutSettings
    engine: str
    tie: float
    judged: str
    idea: str | None


def prompt_values(
    facts: RunFacts, brief: Brief, *, criticised: bool = False
) -> dict[str, Any]:
    """Return the names that templates may use, and their values; ``criticised``: the request is one for a critique."""
    return {
        **_assignment_values(facts, brief),
        **_scene_values(facts, brief),
        **_feedback_values(facts, brief, criticised),
    }


def _assignment_values(facts: RunFacts, brief: Brief) -> dict[str, Any]:
    """What is asked for, of which kind, and by which rules."""
    given = brief.representation.given(brief.task)
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
        "judged": facts.judged,
        "tie": f"{facts.tie:g}",
        **plan_limits(),
    }


def _scene_values(facts: RunFacts, brief: Brief) -> dict[str, Any]:
    """The task and the arm, and how plans are executed; what plugins add comes after it."""
    task = brief.task
    mounted = brief.representation.given(task) or Tool(gripper=brief.gripper)
    values = {}
    for name, compute in installed().factories("prompt_value").items():
        values[name] = compute(brief, mounted, facts.rollout, facts.engine)

    return values | {
        "task": task,
        "told": facts.settings.told,
        "unseen": not facts.level.numbers,
        "robot": task.robot,
        "tool_friction": brief.representation.material.made(mounted).friction,
        "home_xyz": f"({short_numbers(task.home.position, 4, ', ')})",
        "home_rpy": f"({short_numbers(task.home.rpy, 4, ', ')})",
        "executor": function_source(plan_motion),
        "rollout": facts.rollout,
        "hold_s": max(facts.rollout.hold_s, task.hold_s),
        **NOTHING_TOLD,
        **facts.level.values(task, brief.scene_seed),
    }


def _feedback_values(facts: RunFacts, brief: Brief, criticised: bool) -> dict[str, Any]:
    """What was tried before, and what came of it."""
    task = brief.task
    sight = facts.level.sight(task, brief.scene_seed)
    paper = facts.settings.feedback == "paper"
    candidates = ""
    if not paper:
        last = last_generation(brief.tried)
        most = facts.settings.generation_characters
        candidates = generation_lines(last, most, sight)

    # Plans and their rollouts are all that plans for a given tool differ in.
    given = brief.representation.given(task) is not None
    numbers = criticised or given or not paper
    return {
        "feedback": facts.settings.feedback,
        "elites": elites_text(
            brief.elites, brief.representation, task, numbers=numbers, sight=sight
        ),
        "critiques": critiques_text(brief),
        "candidates": candidates,
        "detailed": any(elite.combined or elite.figures for elite in brief.elites),
        "solved": any(elite.reward >= 1 - facts.tie for elite in brief.elites),
    }

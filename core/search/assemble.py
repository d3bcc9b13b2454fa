"""Assemble a designer: what its model is shown, and what helps it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

import pluggy

from core.config.schemas import Sampling
from core.design import Tool
from core.designs.composer import PromptComposer
from core.designs.rules import given_tool
from core.errors import UsageError
from core.interfaces import VLM, Simulator
from core.search.assignment import Assignment, borne_kinds
from core.search.critic import Critic
from core.search.designer import ModelDesigner
from core.search.prompt_pictures import pictures_by_task, strips
from core.search.several import TaskPlanner
from core.support.cli import say


def make_designer(
    assignment: Assignment,
    create: Callable[[], Simulator],
    vlm: VLM,
    prompts: PromptComposer,
    sampling: Sampling,
    events: pluggy.PluginManager,
    prompts_of: Mapping[str, PromptComposer] = MappingProxyType({}),
) -> ModelDesigner:
    """Make a designer that shows the model pictures of the scene and of rollouts, drawn by what ``create`` makes.

    ``prompts_of`` composes the requests for plans for each of several tasks.

    An engine with a loaded scene holds 100 MB. So the one that drew the scene is let go, and one for rollouts is made
    when the first is drawn. Where nothing can draw, standard error says why, and the model gets text alone.

    Raises:
        UsageError: the model or the task is not one for the level ``prompt.told``.
        UserError: no tool kind that the robot can bear, no given tool for the task, or one that breaks a rule.
    """
    _check_level(assignment, vlm, prompts)
    task = assignment.task
    given = given_tool(assignment.representation, task)
    if given is None:
        assignment = replace(
            assignment, tool_kinds=borne_kinds(assignment.tool_kinds, task.robot)
        )
        mounted = [
            Tool(gripper=name == "gripper")
            for name in dict.fromkeys(assignment.tool_kinds)
        ]
    else:
        mounted = [given]
    pictures, drawable = pictures_by_task(
        task, create, prompts, assignment.seed, mounted
    )
    film = strips(task, create, assignment.seed, prompts.rollout) if drawable else None

    critic = None
    count = prompts.settings.critic
    if count and vlm.criticises:
        critic = Critic(prompts, sampling.temperature, film)
    elif count:
        say(
            f"prompt.critic={count}: {vlm.model} writes no critiques; there are none",
            file=sys.stderr,
        )

    planner = None
    if len(task.parts) > 1:
        planner = TaskPlanner(
            task,
            assignment.representation,
            assignment.actions,
            assignment.budget.n_action,
            prompts_of,
            pictures,
            vlm.takes_schema,
        )
    return ModelDesigner(
        assignment, vlm, prompts, sampling, events, pictures, planner, film, critic
    )


def _check_level(assignment: Assignment, vlm: VLM, prompts: PromptComposer) -> None:
    """Check that the model and the task are ones for the level ``prompt.told``.

    Raises:
        UsageError: they are not.
    """
    told = prompts.settings.told
    level = prompts.level
    task = assignment.task
    if level.in_words and not task.in_words:
        raise UsageError(
            f"{task.name} has no text without numbers for prompt.told={told}: give it `in_words`"
        )
    if level.numbers:
        return
    if not vlm.sees:
        raise UsageError(
            f"{vlm.model} reads the scene's numbers, not pictures: prompt.told={told} needs a model that sees"
        )
    if len(task.parts) > 1:
        raise UsageError(
            f"prompt.told={told} shows one scene, and {task.name} has several: use words or source"
        )

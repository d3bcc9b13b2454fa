"""Build the fitness and the designer of a search."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import pluggy
from omegaconf import DictConfig

from core.config.compose import part, task_part
from core.config.schemas import Sampling
from core.design import Tool
from core.designs.composer import PromptComposer
from core.designs.rules import given_tool
from core.errors import UsageError
from core.interfaces import VLM, Condition, Fitness, RolloutSettings, Simulator, Task
from core.plugins import FITNESS, SIMULATOR, PluginPart
from core.robot.kinematics import arm_of
from core.search.assignment import Assignment
from core.search.critic import Critic
from core.search.designer import ModelDesigner
from core.search.prompt_pictures import StripArtist, prompt_pictures
from core.support.cli import say


@dataclass(frozen=True, eq=False)
class DesignerParts:
    """What a designer is made of.

    Attributes:
        assignment: what is asked for.
        fitness: judges what comes.
        engine: makes an engine, which draws the scene and rollouts.
        vlm: the model.
        prompts: composes the requests.
        sampling: the temperatures.
        events: receives requests and replies.
    """

    assignment: Assignment
    fitness: Fitness
    engine: Callable[[], Simulator]
    vlm: VLM
    prompts: PromptComposer
    sampling: Sampling
    events: pluggy.PluginManager

    @property
    def mounted(self) -> Sequence[Tool]:
        """What the arm carries in pictures of the scene: the given tool, or no tool, on each kind of mount.

        Raises:
            UserError: the given tool breaks a rule.
        """
        assignment = self.assignment
        given = given_tool(assignment.representation, assignment.task)
        if given is not None:
            return [given]
        kinds = dict.fromkeys(assignment.tool_kinds)
        return [Tool(gripper=kind == "gripper") for kind in kinds]


class SearchBuilder:
    """Builds the fitness and the designer of a search. A task may name a builder of its own (`Task.builder`)."""

    asks_for_plans: ClassVar[bool] = False  # for tools that the model designed before

    def build_fitness(self, cfg: DictConfig, settings: RolloutSettings) -> Fitness:
        """Make the fitness that a configuration names.

        Raises:
            UserError: a part or setting that can't be used.
        """
        return build_fitness_in(task_part(cfg), cfg, settings)

    def build_designer(self, parts: DesignerParts) -> ModelDesigner:
        """Make a designer that shows the model pictures of the scene and of rollouts.

        An engine with a loaded scene holds 100 MB. So the one that drew the scene is let go, and one for rollouts is
        made when the first is drawn. Where nothing can draw, standard error says why, and the model gets text alone.

        Raises:
            UsageError: the model or the task is not one for the level ``prompt.told``.
        """
        check_level(parts)
        assignment = parts.assignment
        task = assignment.task
        pictures, drawable = prompt_pictures(
            task, parts.engine(), parts.prompts, assignment.seed, parts.mounted
        )
        designer = ModelDesigner(
            assignment, parts.vlm, parts.prompts, parts.sampling, parts.events, pictures
        )
        equip(designer, parts, drawable=drawable)

        return designer


def builder_for(task: PluginPart[Task]) -> SearchBuilder:
    """Make the builder of searches for a task."""
    builder: SearchBuilder = (task.declared("builder", None) or SearchBuilder)()
    return builder


def build_fitness_in(
    task: PluginPart[Task], cfg: DictConfig, settings: RolloutSettings
) -> Fitness:
    """Make the fitness that a configuration names, for a task.

    Raises:
        UserError: a part or setting that can't be used.
    """
    condition = Condition(task, part(SIMULATOR, cfg.sim), cfg.seed, settings)
    fitness: Fitness = part(FITNESS, cfg.fitness).create(condition=condition)
    return fitness


def check_starts(task: Task) -> None:
    """Check that the arm can start a task, so that it is reported once, before anything is drawn or tried.

    Raises:
        UserError: it can't reach the home pose.
    """
    for stage in task.parts:
        arm_of(task.robot).home_for(stage.home)


def equip(designer: ModelDesigner, parts: DesignerParts, *, drawable: bool) -> None:
    """Give a designer what draws film strips, if anything can, and the critic that the prompts' settings ask for."""
    prompts = parts.prompts
    vlm = parts.vlm
    assignment = parts.assignment

    if drawable:
        artist = StripArtist(
            assignment.task,
            parts.engine,
            assignment.seed,
            prompts.rollout,
            prompts.level,
        )
        designer.film = artist.draw

    count = prompts.settings.critic
    if count and vlm.criticises:
        designer.critic = Critic(prompts, parts.sampling.temperature, designer.film)
    elif count:
        say(
            f"prompt.critic={count}: {vlm.model} writes no critiques; there are none",
            file=sys.stderr,
        )


def check_level(parts: DesignerParts) -> None:
    """Check that the model and the task are ones for the level ``prompt.told``.

    Raises:
        UsageError: they are not.
    """
    name = parts.prompts.settings.told
    level = parts.prompts.level
    task = parts.assignment.task
    if level.in_words and not task.in_words:
        raise UsageError(
            f"{task.name} has no text without numbers for prompt.told={name}: give it `in_words`"
        )

    if not level.numbers and not parts.vlm.sees:
        raise UsageError(
            f"{parts.vlm.model} reads the scene's numbers, not pictures: prompt.told={name} needs a model that sees"
        )

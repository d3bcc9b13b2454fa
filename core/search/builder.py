"""Build the fitness and the designer of a search."""

from __future__ import annotations

from typing import ClassVar

from omegaconf import DictConfig

from core.config.compose import part, task_part
from core.interfaces import Condition, Fitness, RolloutSettings, Task
from core.plugins import FITNESS, SIMULATOR, PluginPart, installed
from core.robot.kinematics import arm_of
from core.search.designer import ModelDesigner


class SearchBuilder:
    """Builds the fitness and the designer of a search. A task may name a builder of its own (`Task.builder`)."""

    asks_for_plans: ClassVar[bool] = False  # for tools that the model designed before

    def build_fitness(self, cfg: DictConfig, settings: RolloutSettings) -> Fitness:
        """Make the fitness that a configuration names.

        Raises:
            UserError: a part or setting that can't be used.
        """
        return build_fitness_in(task_part(cfg), cfg, settings)

    def finish(self, designer: ModelDesigner, fitness: Fitness) -> ModelDesigner:
        """Give a designer the pictures of the scene that it shows the model.

        Where nothing can draw, standard error says why, and the model gets text alone. Another designer may be
        returned in its place.

        Raises:
            UserError: a prompt without numbers can't be drawn.
        """
        task = designer.assignment.task
        designer.pictures = designer.artist.draw_scene(task)
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
    return part(FITNESS, cfg.fitness).create(condition=condition)


def check_starts(task: Task) -> None:
    """Check that the arm can start a task, and find the rules for tools, before anything is drawn, asked or tried.

    Raises:
        UserError: the arm can't reach the home pose, or a rule can't be imported.
    """
    installed().factories("tool_rule")
    for stage in task.parts:
        arm_of(task.robot).home_for(stage.home)


def finish_designer(
    builder: SearchBuilder, designer: ModelDesigner, fitness: Fitness, cfg: DictConfig
) -> ModelDesigner:
    """Let a builder finish a designer, which then has an artist, and the critic and the mender that are asked for.

    Raises:
        UserError: a prompt without numbers can't be drawn.
    """
    engine = part(SIMULATOR, cfg.sim)
    for make in installed().factories("artist").values():
        designer.artist = make(designer.assignment, designer.prompts, engine.create)

    designer = builder.finish(designer, fitness)
    equip(designer)
    return designer


def equip(designer: ModelDesigner) -> None:
    """Give a designer the critic and the mender that the prompts' settings ask for."""
    settings = designer.prompts.facts.settings

    if settings.repair:
        for make in installed().factories("mender").values():
            designer.mender = make(designer.prompts)

    if settings.critic and designer.vlm.criticises:
        for make in installed().factories("critic").values():
            designer.critic = make(designer)

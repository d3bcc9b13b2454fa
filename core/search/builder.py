"""Build the fitness and the designer of a search."""

from __future__ import annotations

from typing import ClassVar

from omegaconf import DictConfig

from core.config.compose import part, task_part
from core.designs.composer import PromptComposer
from core.interfaces import Condition, Fitness, RolloutSettings, Task
from core.plugins import FITNESS, SIMULATOR, PluginPart, installed
from core.robot.kinematics import arm_of
from core.search.assignment import Assignment
from core.search.designer import Artist, ModelDesigner


class SearchBuilder:
    """Builds the fitness and the designer of a search. A task may name a builder of its own (`Task.builder`)."""

    asks_for_plans: ClassVar[bool] = False  # for tools that the model designed before

    def build_fitness(self, cfg: DictConfig, settings: RolloutSettings) -> Fitness:
        """Make the fitness that a configuration names.

        Raises:
            UserError: a part or setting that can't be used.
        """
        return build_fitness_in(task_part(cfg), cfg, settings)

    def finish(
        self, designer: ModelDesigner, fitness: Fitness, artist: Artist
    ) -> ModelDesigner:
        """Give a designer what it shows the model: pictures of the scene and of rollouts, and critiques.

        Where nothing can draw, standard error says why, and the model gets text alone. Another designer may be
        returned in its place.

        Raises:
            UserError: a prompt without numbers can't be drawn.
        """
        designer.pictures = artist.draw_scene(designer.assignment.task)
        equip(designer, artist)
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


def make_artist(
    assignment: Assignment, prompts: PromptComposer, cfg: DictConfig
) -> Artist:
    """Make what draws for prompts, with the engine that a configuration names."""
    engine = part(SIMULATOR, cfg.sim)
    for make in installed().factories("artist").values():
        artist: Artist = make(assignment, prompts, engine.create)
        return artist
    return Artist()


def equip(designer: ModelDesigner, artist: Artist) -> None:
    """Give a designer what draws film strips, and the critic and the mender that the prompts' settings ask for."""
    designer.artist = artist
    settings = designer.prompts.facts.settings

    if settings.repair:
        for make in installed().factories("mender").values():
            designer.mender = make(designer.prompts)

    if settings.critic and designer.vlm.criticises:
        for make in installed().factories("critic").values():
            designer.critic = make(designer)

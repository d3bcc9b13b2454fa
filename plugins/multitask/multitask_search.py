"""Build the fitness and the designer of a search for one tool for several tasks."""

from __future__ import annotations

from dataclasses import replace

from omegaconf import DictConfig

from core.config.compose import task_parts
from core.designs.composer import PromptComposer
from core.errors import UsageError
from core.interfaces import Fitness, Picture, RolloutSettings, Task
from core.search.builder import SearchBuilder, build_fitness_in
from core.search.designer import ModelDesigner, ScenePictures
from plugins.multitask.designer import MultitaskDesigner
from plugins.multitask.fitness import Together
from plugins.multitask.joined_plans import TaskActions


class MultitaskSearch(SearchBuilder):
    """Builds a fitness of those in each task, and a designer that asks for plans for each."""

    asks_for_plans = True

    def build_fitness(self, cfg: DictConfig, settings: RolloutSettings) -> Fitness:
        by_task = {
            task.shared().name: build_fitness_in(task, cfg, settings)
            for task in task_parts(cfg)
        }
        return Together(by_task, cfg.task.get("combine", "mean"))

    def finish(self, designer: ModelDesigner, fitness: Fitness) -> MultitaskDesigner:
        assignment = designer.assignment
        task = assignment.task
        prompts = designer.prompts
        if not prompts.facts.level.numbers:
            raise UsageError(
                f"prompt.context={prompts.facts.settings.context} shows one scene, and {task.name} has several: "
                "use words or source"
            )

        pictures: dict[str, ScenePictures] = {}
        for number, part in enumerate(task.parts):
            pictures[part.name] = {
                gripper: tuple(_name(picture, part, number) for picture in shown)
                for gripper, shown in designer.artist.draw_scene(part).items()
            }

        assert isinstance(fitness, Together)
        return MultitaskDesigner(
            replace(assignment, actions=TaskActions()),
            designer.vlm,
            prompts,
            designer.sampling,
            designer.events,
            _join(pictures),
            designer.artist,
            plan_actions=assignment.actions,
            plan_prompts={
                name: PromptComposer(
                    replace(prompts.facts, judged=judge.instructions())
                )
                for name, judge in fitness.by_task.items()
            },
            plan_pictures=pictures,
        )


def _name(picture: Picture, task: Task, number: int) -> Picture:
    """Name a picture of a scene by its task."""
    usual = f"The scene of {task.name}, before the motion, without a tool:"
    caption = picture.caption or usual
    return replace(picture, name=f"{picture.name}_t{number}", caption=caption)


def _join(pictures: dict[str, ScenePictures]) -> ScenePictures:
    """Put the pictures of all scenes in one row."""
    joined: dict[bool, tuple[Picture, ...]] = {}
    for by_gripper in pictures.values():
        for gripper, drawn in by_gripper.items():
            joined[gripper] = (*joined.get(gripper, ()), *drawn)

    return joined

"""Make the pictures that a prompt shows: of scenes, and of rollouts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

from core.design import Tool
from core.designs.composer import PromptComposer
from core.errors import RAISED, NoPicture, UserError
from core.interfaces import Picture, RolloutSettings, Simulator, Task
from core.simulation.pictures import SIZE, filmed, png, report_missing
from core.task import Level
from core.trial import Evaluation

ScenePictures = Mapping[bool, tuple[Picture, ...]]
"""The pictures of a scene, without the gripper (False) and with it."""


def shown_in(task: Task, evaluation: Evaluation) -> tuple[Task, Evaluation]:
    """Return the task of the trial that is shown, and what the candidate earned in it."""
    shown = evaluation.shown
    if shown is not None:
        for part in task.parts:
            if part.name == shown.task:
                return part, evaluation.in_task(part.name)
    return task, evaluation.in_task(task.name)


@dataclass(eq=False)
class StripArtist:
    """Draws film strips of rollouts.

    Attributes:
        task: what was to be done.
        engine: makes an engine, once a strip is drawn.
        seed: of the layout, where an evaluation has no trial.
        rollout: how plans are executed.
        level: draws the strips of what it is shown.
    """

    task: Task
    engine: Callable[[], Simulator]
    seed: int
    rollout: RolloutSettings
    level: Level

    @cached_property
    def _simulator(self) -> Simulator:
        return self.engine()

    def draw(self, evaluation: Evaluation) -> Picture | None:
        """Draw the trial that is shown; None: that fails, and standard error says why."""
        task, evaluation = shown_in(self.task, evaluation)
        candidate = evaluation.candidate
        shown = evaluation.shown
        layout = self.seed if shown is None else shown.layout
        # Of several trials what was observed may be of another engine, or perturbed.
        seen = None if evaluation.combined else evaluation.observation

        try:
            recording, draw = filmed(
                task,
                self._simulator,
                candidate,
                layout,
                self.rollout,
                self.level.frame_size,
            )
            strip = self.level.strip(recording, draw, seen)
        except OSError:  # the machine fails: a request without the picture would be paid for all the same
            raise
        except RAISED as error:  # else it costs the picture, never the run
            report_missing(f"film strip of {candidate.id}", error)
            return None

        if strip is None:
            return None
        return Picture(png(strip), f"strip_{candidate.id}")


def prompt_pictures(
    task: Task,
    simulator: Simulator,
    prompts: PromptComposer,
    seed: int,
    mounted: Sequence[Tool],
) -> tuple[ScenePictures, bool]:
    """Make the pictures of the scene that the prompt's settings ask for: drawn and photographed.

    Return them, and whether anything can draw here. Where the prompt has the scene's numbers too, a picture that fails
    is left out, and standard error says why.

    Raises:
        UserError: the machine fails, or a prompt without numbers can't be drawn.
    """
    settings = prompts.settings
    numbers = prompts.level.numbers
    photographs: tuple[Picture, ...] = ()
    if settings.photographs != "none":
        photographs = tuple(task.photographs())
    alone = bool(photographs) and settings.photographs == "alone"
    wanted = (settings.picture or not numbers) and not alone

    drawn: dict[bool, tuple[Picture, ...]] = {}
    drawable = True
    for number, tool in enumerate(mounted if wanted else ()):
        name = "scene_gripper" if number else "scene"
        try:
            drawn[tool.gripper] = _draw(task, simulator, prompts, seed, tool, name)
        except NoPicture as error:
            if not numbers:
                why = f"prompt.told={settings.told} shows pictures alone, and nothing here draws them: {error}"
                raise UserError(why) from error

            report_missing("pictures", error)
            drawable = False
            break
        except OSError as error:
            raise UserError(f"the scene can't be drawn: {error}") from error
        except RAISED as error:
            if not numbers:
                raise
            report_missing("picture of the scene", error)

    pictures = {
        tool.gripper: (*drawn.get(tool.gripper, ()), *photographs) for tool in mounted
    }
    return pictures, drawable


def _draw(
    task: Task,
    simulator: Simulator,
    prompts: PromptComposer,
    seed: int,
    tool: Tool,
    name: str,
) -> tuple[Picture, ...]:
    """Draw the scene with what the arm carries: one picture, or those of the prompt's level where it has no numbers."""
    render = partial(simulator.render, task, seed=seed, tool=tool)
    if not prompts.level.numbers:
        return prompts.level.draw(task, seed, render)
    width, height = SIZE
    return (Picture(png(render(width=width, height=height)), name),)

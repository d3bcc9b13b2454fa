"""Make the pictures that a prompt shows: of scenes, and of rollouts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial

from core.design import Tool
from core.designs.composer import PromptComposer
from core.errors import RAISED, NoPicture, UserError
from core.interfaces import Picture, RolloutSettings, Simulator, Task
from core.search.together import weakest
from core.simulation.pictures import SIZE, png, report_missing
from core.simulation.strip import draw_strip
from core.trial import Evaluation


def pictures_by_task(
    task: Task,
    create: Callable[[], Simulator],
    prompts: PromptComposer,
    seed: int,
    mounted: Sequence[Tool],
) -> tuple[dict[str, dict[bool, tuple[Picture, ...]]], bool]:
    """Make the pictures of each part of a task (`prompt_pictures`); those of several are named by it."""
    found, drawable = dict[str, dict[bool, tuple[Picture, ...]]](), True
    for number, part in enumerate(task.parts):
        made, can_draw = prompt_pictures(part, create(), prompts, seed, mounted)
        drawable = drawable and can_draw
        if len(task.parts) > 1:
            made = {
                kind: tuple(_named(picture, part, number) for picture in own)
                for kind, own in made.items()
            }
        found[part.name] = made
    return found, drawable


def _named(picture: Picture, task: Task, number: int) -> Picture:
    caption = (
        picture.caption
        or f"The scene of {task.name}, before the motion, without a tool:"
    )
    return replace(picture, name=f"{picture.name}_t{number}", caption=caption)


def strips(
    task: Task, create: Callable[[], Simulator], seed: int, rollout: RolloutSettings
) -> Callable[[Evaluation], Picture | None]:
    """Return a function that draws a film strip of a rollout, of several tasks in that with the lowest reward."""
    simulator = cache(create)

    def show(evaluation: Evaluation) -> Picture | None:
        where, evaluation = weakest(task, evaluation)
        candidate, shown = evaluation.candidate, evaluation.shown
        layout = seed if shown is None else shown.layout
        seen = (
            None if evaluation.combined else evaluation.observation
        )  # else of another engine or perturbed
        try:
            strip = draw_strip(where, simulator(), candidate, layout, rollout, seen)
        except OSError:  # the machine fails: a request without the picture would be paid for all the same
            raise
        except (
            RAISED
        ) as error:  # else a picture that fails costs the picture, never the run
            report_missing(f"film strip of {candidate.id}", error)
            return None
        return Picture(png(strip), f"strip_{candidate.id}")

    return show


def prompt_pictures(
    task: Task,
    simulator: Simulator,
    prompts: PromptComposer,
    seed: int,
    mounted: Sequence[Tool],
) -> tuple[dict[bool, tuple[Picture, ...]], bool]:
    """Make the pictures of the scene that the prompt's settings ask for: drawn and photographed.

    Return them without the gripper (False) and with it, and whether anything can draw here. Where the prompt has the
    scene's numbers too, a picture that fails is left out, and standard error says why.

    Raises:
        UserError: the machine fails, or a prompt without numbers can't be drawn.
    """
    settings, level = prompts.settings, prompts.level
    own = tuple(task.photographs()) if settings.photographs != "none" else ()
    drawn, drawable, unseen = dict[bool, tuple[Picture, ...]](), True, not level.numbers
    alone = bool(own) and settings.photographs == "alone"
    for number, tool in enumerate(
        mounted if (unseen or settings.picture) and not alone else ()
    ):
        try:
            if unseen:
                render = partial(simulator.render, task, seed=seed, tool=tool)
                drawn[tool.gripper] = level.draw(task, seed, render)
                continue
            picture = png(
                simulator.render(
                    task, seed=seed, tool=tool, width=SIZE[0], height=SIZE[1]
                )
            )
            drawn[tool.gripper] = (
                Picture(picture, "scene_gripper" if number else "scene"),
            )
        except NoPicture as error:
            if unseen:
                why = f"prompt.told={settings.told} shows pictures alone, and nothing here draws them: {error}"
                raise UserError(why) from error
            report_missing("pictures", error)
            drawable = False
            break
        except OSError as error:
            raise UserError(f"the scene can't be drawn: {error}") from error
        except RAISED as error:
            if unseen:
                raise
            report_missing("picture of the scene", error)
    return {
        tool.gripper: (*drawn.get(tool.gripper, ()), *own) for tool in mounted
    }, drawable

"""Make the pictures of the scene that a prompt shows.

Covered by `tests/plugins/tasks/file/test_photos.py`.
"""

from __future__ import annotations

from collections.abc import Sequence

from core.config.schemas import UNSEEN, PromptSettings
from core.design import Tool
from core.errors import RAISED, NoPicture, UserError
from core.interfaces import Picture, Simulator, Task
from core.simulation.depth import depth_picture
from core.simulation.pictures import SIZE, png, report_missing
from core.simulation.views import calibrated_pictures


def prompt_pictures(
    task: Task, simulator: Simulator, settings: PromptSettings, seed: int, mounted: Sequence[Tool]
) -> tuple[dict[bool, tuple[Picture, ...]], bool]:
    """Make the pictures of the scene that the prompt's settings ask for: drawn, photographed, and measured.

    Return them without the gripper (False) and with it, and whether anything can draw here. Where the prompt has the
    scene's numbers too, a picture that fails is left out, and standard error says why.

    Raises:
        UserError: the machine fails, or a prompt without numbers can't be drawn.
    """
    own = tuple(task.photographs()) if settings.photographs != "none" else ()
    more = (*own, *([depth_picture(task, seed)] if settings.depth else []))
    drawn, drawable, unseen = dict[bool, tuple[Picture, ...]](), True, settings.told in UNSEEN
    alone = bool(own) and settings.photographs == "alone"
    for number, tool in enumerate(mounted if (unseen or settings.picture) and not alone else ()):
        try:
            if unseen:
                drawn[tool.gripper] = calibrated_pictures(task, simulator, seed, tool, settings.told)
                continue
            picture = png(simulator.render(task, seed=seed, tool=tool, width=SIZE[0], height=SIZE[1]))
            drawn[tool.gripper] = (Picture(picture, "scene_gripper" if number else "scene"),)
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
    return {tool.gripper: (*drawn.get(tool.gripper, ()), *more) for tool in mounted}, drawable

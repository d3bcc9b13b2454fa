"""Make the pictures of the scene that a prompt shows.

Covered by `tests/plugins/tasks/file/test_photos.py`.
"""

from __future__ import annotations

from collections.abc import Sequence

from core.config.schemas import UNSEEN, PromptSettings
from core.design import Tool
from core.errors import NoPicture, UserError
from core.interfaces import Picture, Simulator, Task
from core.simulation.depth import depth_picture
from core.simulation.pictures import scene_pictures
from core.simulation.views import calibrated_pictures


def prompt_pictures(
    task: Task, simulator: Simulator, settings: PromptSettings, seed: int, mounted: Sequence[Tool]
) -> tuple[dict[bool, tuple[Picture, ...]], bool]:
    """Make the pictures of the scene that the prompt's settings ask for: drawn, photographed, and measured.

    Return them without the gripper (False) and with it, and whether anything can draw here.
    """
    own = tuple(task.photographs()) if settings.photographs != "none" else ()
    alone = bool(own) and settings.photographs == "alone"
    more = (*own, *([depth_picture(task, seed)] if settings.depth else []))
    drawn, drawable = _rendered(task, simulator, settings, seed, () if alone else mounted)
    return {t.gripper: (*drawn.get(t.gripper, ()), *more) for t in mounted}, drawable


def _rendered(
    task: Task, simulator: Simulator, settings: PromptSettings, seed: int, mounted: Sequence[Tool]
) -> tuple[dict[bool, tuple[Picture, ...]], bool]:
    """Render the scene with each of these tools; see `core.simulation.pictures.scene_pictures`."""
    if settings.told not in UNSEEN:
        made, drawable = scene_pictures(task, simulator, settings.picture, seed, mounted)
        return {gripper: (picture,) for gripper, picture in made.items()}, drawable
    try:
        return {t.gripper: calibrated_pictures(task, simulator, seed, t, settings.told) for t in mounted}, True
    except NoPicture as error:
        raise UserError(
            f"prompt.told={settings.told} shows pictures alone, and nothing here draws them: {error}"
        ) from error

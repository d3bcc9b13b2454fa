"""Refuse soft bodies in an engine that has none."""

from __future__ import annotations

from core.errors import UserError
from core.scene import Scene


def only_rigid(scene: Scene, task: str, engine: str) -> Scene:
    """Return the scene.

    Raises:
        UserError: it has soft bodies.
    """
    if scene.softs:
        names = ", ".join(soft.name for soft in scene.softs)
        raise UserError(
            f"{task}: sim={engine} can't have soft bodies ({names}) in a scene; use sim=mujoco, or sims=[mujoco]"
        )
    return scene

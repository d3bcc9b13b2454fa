"""Find the scene that a rollout is played in."""

from __future__ import annotations

from functools import lru_cache

from core.interfaces import Rollout, Task
from core.scene import Scene


def scene_of(job: Rollout, task: Task) -> Scene:
    """Return the scene to play in: the job's, or else the task's layout; the same object for jobs that share it."""
    if job.scene is None:
        return _layout(task, job.seed)
    scene: Scene = job.scene
    return scene


@lru_cache(maxsize=4)
def _layout(task: Task, seed: int) -> Scene:
    return task.scene(seed)

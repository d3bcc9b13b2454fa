"""Find the scene that a rollout is played in."""

from __future__ import annotations

from functools import lru_cache

from core.interfaces import Rollout, Task
from core.scene import Scene


def scene_of(job: Rollout, task: Task) -> Scene:
    """Return the scene to play in, with its fixture: the job's, or the task's layout; one object for its jobs."""
    if job.scene is None:
        return _layout(task, job.seed).furnished(job.tool)
    return job.scene


@lru_cache(maxsize=4)
def _layout(task: Task, seed: int) -> Scene:
    return task.scene(seed)

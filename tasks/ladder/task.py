"""``task=ladder family=NAME level=N seed=N``: a scene that a family draws, as if a scene file said it."""

from __future__ import annotations

import random
from typing import Any, Literal

from core.errors import UsageError
from core.interfaces import Task
from core.plugins import installed
from core.task import Proof
from core.values.harmless import Harmless
from tasks.ladder import chain, gentle, jobs, places, slender, sort, swing, tunnel
from tasks.ladder.rung import Family, Rung, noise_at

FAMILIES: dict[str, Family] = {
    "chain": chain.draw,
    "gentle": gentle.draw,
    "jobs": jobs.draw,
    "places": places.draw,
    "slender": slender.draw,
    "sort": sort.draw,
    "swing": swing.draw,
    "tunnel": tunnel.draw,
}
CAMERA = {"position": [1.05, -0.7, 0.75], "target": [0.5, 0.0, 0.05]}
Name = Literal[
    "chain", "gentle", "jobs", "places", "slender", "sort", "swing", "tunnel"
]
MOST_NOISE_M = {
    "chain": chain.MOST_NOISE_M,
    "jobs": jobs.MOST_NOISE_M,
    "slender": slender.MOST_NOISE_M,
    "tunnel": tunnel.MOST_NOISE_M,
}


def draw_rung(family: str, level: int, seed: int) -> tuple[Rung, dict[str, Any]]:
    """Draw the rung of a level and a seed, and return it with its scene whole: the same ones each time.

    Raises:
        UsageError: there is no such level or seed.
    """
    if level < 1:
        raise UsageError(f"task.level must be at least 1, got {level}")
    if seed < 0:
        raise UsageError(f"task.seed must be at least 0, got {seed}")

    noise_m = min(noise_at(level), MOST_NOISE_M.get(family, 1.0))
    rng = random.Random(f"{family} {level} {seed}")  # noqa: S311 - no secret
    rung = FAMILIES[family](level, noise_m, rng)
    name = f"{family.title()}{level}Seed{seed}"
    whole = {"name": name, "noise_m": noise_m, "camera": CAMERA, **rung.scene}
    return rung, whole


def make_task(
    family: Name = "sort",
    level: int = 1,
    seed: int = 0,
    variation: Harmless[str] = "wide",
) -> Task:
    """Make the task of a rung.

    Args:
        family: of scenes, which differ in what makes them hard.
        level: from 1 on, without end; each is harder than the one before.
        seed: of the draw; three of them make a score.
        variation: what differs between its layouts: ``wide``, or ``none``.

    Raises:
        UserError: there is no such rung.
    """
    rung, scene = draw_rung(family, level, seed)
    files: Any = installed().factory("task", "file")
    task: Task = files.from_data(scene, variation)
    task.proof = Proof(rung.reference, rung.simpler)
    return task

"""``fitness=robust``: the mean reward over perturbed scenes, in that engine where it is the lowest."""

from __future__ import annotations

from core.hooks import hookimpl


@hookimpl
def fitness_functions() -> dict[str, str]:
    return {"robust": "plugins.fitness.robust.fitness:Robust"}

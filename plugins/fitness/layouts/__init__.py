"""``fitness=layouts``: rewards over several layouts of the task, and over unseen ones at the end."""

from __future__ import annotations

from core.hooks import hookimpl


@hookimpl
def fitness_functions() -> dict[str, str]:
    return {"layouts": "plugins.fitness.layouts.fitness:Layouts"}

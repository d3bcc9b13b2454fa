"""``fitness=buildable``: the reward of another fitness, for designs that can be made and borne."""

from __future__ import annotations

from core.hooks import hookimpl


@hookimpl
def fitness_functions() -> dict[str, str]:
    return {"buildable": "plugins.fitness.buildable.fitness:Buildable"}

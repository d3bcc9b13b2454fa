"""``fitness=nominal``: the reward of one rollout."""

from __future__ import annotations

from core.hooks import hookimpl


@hookimpl
def fitness_functions() -> dict[str, str]:
    return {"nominal": "plugins.fitness.nominal.fitness:Nominal"}

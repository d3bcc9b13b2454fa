"""``evolution=map_elites``: keep the best of each kind of tool and motion, and breed from different kinds."""

from core.hooks import Factories, hookimpl


@hookimpl
def evolution_strategies() -> Factories:
    return {"map_elites": "plugins.strategies.map_elites.strategy:MapElites"}

"""Where candidates come from: ``evolution=vlmgineer``, ``sampling``, ``islands``, ``map_elites`` and ``refined``."""

from core.hooks import Factories, hookimpl


@hookimpl
def evolution_strategies() -> Factories:
    return {
        "vlmgineer": "plugins.strategies.vlmgineer:VLMgineer",
        "sampling": "plugins.strategies.sampling:Sampling",
        "islands": "plugins.strategies.islands:Islands",
        "map_elites": "plugins.strategies.map_elites.strategy:MapElites",
        "refined": "plugins.strategies.refined.strategy:Refined",
    }

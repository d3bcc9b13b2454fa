"""What counts of one or many rollouts: ``fitness=nominal``, ``layouts``, ``lean`` and ``robust``."""

from core.hooks import Factories, hookimpl


@hookimpl
def fitness_functions() -> Factories:
    return {
        "nominal": "plugins.fitness.nominal:Nominal",
        "layouts": "plugins.fitness.layouts:Layouts",
        "lean": "plugins.fitness.lean:Lean",
        "robust": "plugins.fitness.robust:Robust",
    }

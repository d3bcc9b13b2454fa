"""What counts of one or many rollouts: ``fitness=nominal``, ``fitness=layouts`` and ``fitness=robust``."""

from core.hooks import Factories, hookimpl


@hookimpl
def fitness_functions() -> Factories:
    return {
        "nominal": "plugins.fitness.nominal:Nominal",
        "layouts": "plugins.fitness.layouts:Layouts",
        "robust": "plugins.fitness.robust:Robust",
    }

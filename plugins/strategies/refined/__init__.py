"""``evolution=refined``, or ``evolution.refine=N`` with any other: vary the numbers of what a strategy found."""

from core.hooks import Factories, hookimpl


@hookimpl
def evolution_strategies() -> Factories:
    return {"refined": "plugins.strategies.refined.strategy:Refined"}

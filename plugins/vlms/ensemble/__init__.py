"""Several models at once: each request goes to the one whose answers have earned most for their cost."""

from core.hooks import Factories, hookimpl


@hookimpl
def vlms() -> Factories:
    return {"ensemble": "plugins.vlms.ensemble.model:Ensemble"}

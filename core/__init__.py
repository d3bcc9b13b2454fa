"""VLMgineer's framework: the types, the interfaces and the loop. It knows no engine, no model and no task."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from core.search.experiment import Experiment

__all__ = ["Experiment"]


def __getattr__(name: str) -> Any:
    """Import `Experiment` when it is first used; most commands do not need it."""
    if name != "Experiment":
        raise AttributeError(f"module 'core' has no attribute {name!r}")
    from core.search.experiment import Experiment

    return Experiment

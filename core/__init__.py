"""VLMgineer's framework: the types, the interfaces and the loop. It knows no engine, no model and no task."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from core.experiment import Experiment

__all__ = ["Experiment"]


def __getattr__(name: str) -> Any:
    """`Experiment` is imported when it is first asked for: most of what is here does without it."""
    if name != "Experiment":
        raise AttributeError(f"module 'core' has no attribute {name!r}")
    from core.experiment import Experiment

    return Experiment

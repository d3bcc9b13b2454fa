"""VLMgineer's framework: the types, the interfaces and the loop. It knows no engine, no model and no task."""

import importlib.abc
import importlib.machinery
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from core.search.orchestration import Experiment

__all__ = ["Experiment"]


class _Moved(importlib.abc.MetaPathFinder):
    """Asked last for a module: name the new place of one that moved."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname.startswith("core."):
            from core.plugins.moved import new_place

            place = new_place(fullname)
            if place is not None:
                raise ModuleNotFoundError(place, name=fullname)
        return None


sys.meta_path.append(_Moved())


def __getattr__(name: str) -> Any:
    """Import `Experiment` when it is first used; most commands do not need it."""
    if name != "Experiment":
        raise AttributeError(f"module 'core' has no attribute {name!r}")
    from core.search.orchestration import Experiment

    return Experiment

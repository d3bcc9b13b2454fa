"""Choose few tools that do many tasks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Covers = NDArray[np.bool_]
"""(tools, tasks), whether a tool does a task."""


def best_sets(covers: Covers) -> list[list[int]]:
    """Return sets of one tool and more: each adds the tool that does most of what is left, until none adds a task."""
    sets: list[list[int]] = []
    left = covers.any(axis=0)
    while left.any():
        best = int(covers[:, left].sum(axis=1).argmax())
        sets.append([*sets[-1], best] if sets else [best])
        left = left & ~covers[best]

    return sets

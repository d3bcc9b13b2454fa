"""Choose few tools that do many tasks: the best set of each size."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Covers = NDArray[np.bool_]
"""(tools, tasks), whether a tool does a task."""


def best_sets(covers: Covers) -> list[list[int]]:
    """Return for each number of tools, from one on, a set that does the most tasks; until more tools add none."""
    from scipy.optimize import Bounds, LinearConstraint, milp  # takes a while to import

    tools, tasks = covers.shape
    done_by_chosen = LinearConstraint(np.hstack([-covers.T.astype(float), np.eye(tasks)]), ub=0.0)
    each, whole = np.r_[np.ones(tools), np.zeros(tasks)], Bounds(0, 1)
    found = list[list[int]]()
    while not found or covers[found[-1]].any(axis=0).sum() < covers.any(axis=0).sum():
        count = LinearConstraint(each[None], ub=len(found) + 1)
        cost = each / (tools + 1) - (1 - each)  # as few tools as suffice
        solved = milp(cost, integrality=each, bounds=whole, constraints=[done_by_chosen, count])
        if not solved.success:
            raise RuntimeError(f"the cover was not solved: {solved.message}")
        found.append([int(tool) for tool in np.flatnonzero(solved.x[:tools] > 0.5)])
    return found if found[0] else []

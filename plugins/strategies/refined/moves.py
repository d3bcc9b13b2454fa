"""Move the numbers of a design at random."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from core.geometry import Array
from core.interfaces import Numbers

SHIFTS = (0.2, 10.0)  # of a move, in steps


def move(
    numbers: Numbers, values: Array, others: Array, rng: np.random.Generator
) -> Array:
    """Return ``values`` (N,) of numbers after a random move of neighbouring points of one table, within the bounds.

    One of their coordinates shifts by up to ten steps, all alike. Or, as often, where there are ``others`` (M, N), the
    points go towards those of one of them, or away, by an amount drawn from the standard normal distribution.
    """
    moved = values.copy()
    table = _draw_points(numbers, rng)
    if len(others) and rng.random() < 0.5:
        points = table.ravel()
        amount = rng.standard_normal()
        other = others[rng.integers(len(others))]
        moved[points] += amount * (other - values)[points]
    else:
        points = table[:, rng.integers(table.shape[1])]
        # Small and large ones as often: nobody knows the scale.
        size = np.exp(rng.uniform(*np.log(SHIFTS)))
        moved[points] += rng.choice((-size, size)) * numbers.steps[points]

    return np.clip(moved, numbers.lower, numbers.upper)


def _draw_points(numbers: Numbers, rng: np.random.Generator) -> npt.NDArray[np.intp]:
    """Draw neighbouring points of one table, of large tables more often; the numbers' indices, (P, C)."""
    ends = np.cumsum([points * width for points, width in numbers.shapes])
    table = int(np.searchsorted(ends, rng.integers(len(numbers)), side="right"))

    points, width = numbers.shapes[table]
    begin, end = np.sort(rng.choice(points + 1, 2, replace=False))
    all_points = np.arange(ends[table] - points * width, ends[table])
    return all_points.reshape(points, width)[begin:end]

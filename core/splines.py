"""Cubic splines by the dozen, each through knots of its own at even steps: what SciPy's `CubicSpline` and
`PchipInterpolator` give one at a time, in a tenth of the time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator
from scipy.linalg import solve_banded
from scipy.linalg.lapack import dgesv

from core.geometry import Array

# Which cells (between two knots) s (N,) are in, and how far they are into them.
Place = tuple[npt.NDArray[np.intp], Array]

_PARABOLA = np.array([[1.0, 1.0, 0.0], [0.5, 2.0, 0.5], [0.0, 1.0, 1.0]])


@dataclass(frozen=True, eq=False)
class _Even:
    """What a spline through K knots at even steps has of their number alone.

    ``at`` (K,) is where they are; ``steps`` (K, 1) lead from each to the next, the last is a filler. Slopes t at the
    knots solve A t = r: ``bands`` (3, K) are A's diagonals, and at the ends r is (p, q, d): p times the slope of the
    outermost cell and q times that of its neighbour, over d ("not-a-knot"; a parabola through three knots, a line
    through two).
    """

    at: Array
    steps: Array
    bands: Array
    first: Array
    last: Array


@lru_cache(maxsize=256)
def _even(count: int) -> _Even:
    at = np.linspace(0.0, 1.0, count)
    dx = np.diff(at)
    bands = np.zeros((3, count))
    if count < 4:
        bands[1] = 1.0  # three knots are seen to elsewhere
        first = last = np.array([count - 1.0, 0.0, 1.0])
    else:
        two, last_two = at[2] - at[0], at[-1] - at[-3]
        bands[0, 1], bands[0, 2:] = two, dx[:-1]
        bands[1, 0], bands[1, 1:-1], bands[1, -1] = dx[1], 2 * (dx[:-1] + dx[1:]), dx[-2]
        bands[2, :-2], bands[2, -2] = dx[1:], last_two
        first = np.array([(dx[0] + 2 * two) * dx[1], dx[0] ** 2, two])
        last = np.array([(2 * last_two + dx[-1]) * dx[-2], dx[-1] ** 2, last_two])
    return _Even(at, np.append(dx, 1.0)[:, None], bands, first, last)


def place(count: int, s: Array) -> Place:
    """Where s (N,), in [0, 1], are on a curve through ``count`` knots."""
    at = _even(count).at
    cells = np.minimum(np.searchsorted(at, s, side="right") - 1, count - 2)
    return cells, s - at[cells]


class Splines:
    """Smooth curves over s in [0, 1], each through ``knots`` (K, D) of its own, K >= 2, at even steps of s.

    Their cells are numbered throughout: those of curve i begin at ``starts[i]``.
    """

    def __init__(self, knots: Sequence[Array]) -> None:
        self.knots = knots
        even = [_even(len(own)) for own in knots]
        ends = np.cumsum([len(own) for own in knots]) - 1
        self.starts = starts = np.append(0, ends[:-1] + 1)
        y, dx = np.concatenate(knots), np.concatenate([e.steps for e in even])
        slopes = np.zeros_like(y)
        slopes[:-1] = np.diff(y, axis=0)
        slopes[ends] = 0.0  # from the end of one curve to the start of the next there is no cell
        slopes /= dx
        right = np.empty_like(y)
        right[1:] = 3 * (dx[1:] * slopes[:-1] + dx[:-1] * slopes[1:])
        p, q, d = np.array([e.first for e in even]).T[..., None]
        right[starts] = (p * slopes[starts] + q * slopes[starts + 1]) / d
        p, q, d = np.array([e.last for e in even]).T[..., None]
        right[ends] = (q * slopes[ends - 2] + p * slopes[ends - 1]) / d
        bands = np.concatenate([e.bands for e in even], axis=1)
        tangents = solve_banded((1, 1), bands, right, overwrite_ab=True, check_finite=False)
        for three in starts[ends - starts == 2]:
            tangents[three : three + 3] = dgesv(_PARABOLA, right[three : three + 3])[2]
        bend = (tangents[:-1] + tangents[1:] - 2 * slopes[:-1]) / dx[:-1]
        square = (slopes[:-1] - tangents[:-1]) / dx[:-1] - bend
        self._coefficients = np.stack([bend / dx[:-1], square, tangents[:-1], y[:-1]])

    def restrain(self, number: int) -> None:
        """Let a curve no longer swing beyond its knots; it is less smooth then."""
        start, own = self.starts[number], self.knots[number]
        at = _even(len(own)).at
        self._coefficients[:, start : start + len(own) - 1] = PchipInterpolator(at, own, axis=0).c

    def places(self, each: Sequence[Place]) -> Place:
        """Of places on each curve one after another, the place on them all."""
        cells = [start + own for start, (own, _) in zip(self.starts, each, strict=True)]
        return np.concatenate(cells), np.concatenate([into for _, into in each])

    def __call__(self, at: Place, derivative: int = 0) -> Array:
        """The curves (N, D) at a place on them all; or their first or second derivative by s."""
        cells, into = at
        cubic, square, linear, constant = self._coefficients.take(cells, axis=1)
        x = into[:, None]
        curve: Array
        match derivative:
            case 0:
                curve = constant + linear * x + square * (x * x) + cubic * (x * x * x)
            case 1:
                curve = linear + square * x * 2 + cubic * (x * x) * 3
            case _:
                curve = square * 2 + cubic * x * 6
        return curve

"""Place knots along a plan's waypoints, and join the arm's joints there to a path.

SciPy's splines are imported inside functions: they take 0.1 s, and each command imports this module.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.linalg.lapack import dgbsv
from scipy.spatial.transform import Rotation

from core.geometry import Array, running_sums, step_lengths
from core.robot.kinematics import Arm

if TYPE_CHECKING:
    from scipy.interpolate import BSpline, CubicHermiteSpline, PchipInterpolator

    JointPath = BSpline | PchipInterpolator  # joints (J,) over s in [0, 1]

# Inverse kinematics is solved at knots this close; a cubic spline joins them.
KNOT_M = 0.02
KNOT_RAD = 0.1
APART_M = 1e-6  # waypoints nearer than this are one place
_LEVER_M = 0.2  # a turn of 1 rad is as long as this
_ROUNDING_RAD = 1e-9


class Knots(NamedTuple):
    """K poses of the mount along a way through N + 1 poses.

    Attributes:
        positions: (K, 3), metres.
        rotations: (K, 3, 3).
        ends: which of the knots are the N + 1 poses.
    """

    positions: Array
    rotations: Array
    ends: list[int]


def place_knots(positions: Array, rotations: Rotation, stops: Sequence[int]) -> Knots:
    """Place knots along a way through poses.

    From pose to pose the position moves on a straight line, and the orientation by SLERP. Where the mount passes poses
    without a stop, both move on a smooth curve through these poses, which overshoots none.

    Args:
        positions: (N + 1, 3) metres.
        rotations: N + 1 of them.
        stops: the numbers of the poses at which the mount rests, the first and the last among them.
    """
    ways = np.diff(positions, axis=0)
    turns = rotations[:-1].inv() * rotations[1:]

    # Lengths one by one: rounded otherwise, a way may get a cell more.
    lengths = np.sqrt([way.dot(way) for way in ways])
    cells = np.maximum(lengths / KNOT_M, turns.magnitude() / KNOT_RAD)
    whole = np.maximum(1, np.ceil(cells).astype(int))
    counts = whole.tolist()
    ends = [0, *accumulate(counts)]

    # For each knot, the number of the way that it lies on, and its share of that way.
    number = np.zeros(ends[-1] + 1, dtype=int)
    number[1:] = np.repeat(np.arange(len(ways)), whole)
    since = np.arange(len(number)) - np.array(ends)[number]
    share = (since * (1.0 / whole)[number])[:, None]
    share[ends[1:]] = 1.0

    slerp = rotations[number] * Rotation.from_rotvec(turns.as_rotvec()[number] * share)
    quaternions = slerp.as_quat(scalar_first=True)
    # To the last bit as a `Pose` would have them.
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    turned = Rotation.from_quat(quaternions, scalar_first=True)
    knots = Knots(positions[number] + share * ways[number], turned.as_matrix(), ends)

    for first, last in pairwise(stops):
        if last > first + 1:
            passed = slice(first, last + 1)
            curve = slice(ends[first] + 1, ends[last] + 1)
            knots.positions[curve], knots.rotations[curve] = _place_on_curve(
                positions[passed], rotations[passed], counts[first:last]
            )

    return knots


def _place_on_curve(
    positions: Array, rotations: Rotation, counts: Sequence[int]
) -> tuple[Array, Array]:
    """Place knots on a smooth curve through poses that overshoots none of them.

    It is a cubic spline in each coordinate, whose slopes at the poses are limited so that it rises or falls between two
    poses as they do: what is level at both stays level. Turns likewise, about the axes of the mount.

    Args:
        positions: (N + 1, 3) metres.
        rotations: N + 1 of them.
        counts: (N,) the cells of each way.

    Returns:
        Positions (K, 3) and rotations (K, 3, 3) of the knots after the first pose.
    """
    ways = step_lengths(positions)
    turns = (rotations[:-1].inv() * rotations[1:]).as_rotvec()
    lengths = np.maximum(ways + _LEVER_M * np.linalg.norm(turns, axis=1), APART_M)
    along = running_sums(lengths)

    places = [
        np.linspace(begin, end, count + 1)[1:]
        for (begin, end), count in zip(pairwise(along), counts, strict=True)
    ]
    place = np.concatenate(places)
    number = np.repeat(np.arange(len(counts)), counts)

    turned = np.vstack([np.zeros(3), np.cumsum(turns, axis=0)])
    since = _interpolate_monotonely(along, turned)(place) - turned[number]
    rotation = rotations[number] * Rotation.from_rotvec(since)
    return _interpolate_monotonely(along, positions)(place), rotation.as_matrix()


def _interpolate_monotonely(along: Array, values: Array) -> CubicHermiteSpline:
    """Interpolate values (N + 1, C) by cubics that are monotone between them.

    The slopes are a cubic spline's, within 0 and three times those of the chords on both sides. This
    suffices by F. N. Fritsch and R. E. Carlson, "Monotone piecewise cubic interpolation", 1980. To take a spline's is a
    proposal of J. M. Hyman, 1983.
    """
    from scipy.interpolate import CubicHermiteSpline, CubicSpline

    chords = np.diff(values, axis=0) / np.diff(along)[:, None]
    before = np.vstack([chords[:1], chords])
    after = np.vstack([chords, chords[-1:]])
    most = np.where(before * after > 0, np.minimum(abs(before), abs(after)), 0)
    rising = np.sign(before)

    slopes = CubicSpline(along, values).derivative()(along)
    limited = rising * np.clip(rising * slopes, 0, 3 * most)
    return CubicHermiteSpline(along, values, limited)


class Spline(NamedTuple):
    """What cubic splines through as many evenly spaced values share.

    Attributes:
        degree: 3, or less through fewer than four values.
        knots: of the spline, from 0 to 1.
        bands: the matrix that makes values of the spline's coefficients, as LAPACK stores one of few diagonals.
        looks: (S,) places close enough to see where it overshoots.
    """

    degree: int
    knots: Array
    bands: Array
    looks: Array

    def join(self, values: Array) -> BSpline:
        """Join values (K, J), to the last bit as SciPy's `make_interp_spline` does it, in a fiftieth of the time."""
        from scipy.interpolate import BSpline

        _, _, coefficients, _ = dgbsv(self.degree, self.degree, self.bands, values)
        return BSpline.construct_fast(
            self.knots, np.ascontiguousarray(coefficients), self.degree
        )


@lru_cache(maxsize=64)
def prepare_spline(count: int) -> Spline:
    """Prepare splines through so many values, at least 2, at even places from 0 to 1."""
    from scipy.interpolate import BSpline, make_interp_spline

    degree = min(3, count - 1)
    places = np.linspace(0.0, 1.0, count)
    knots = make_interp_spline(places, places, degree).t
    matrix = BSpline.design_matrix(places, knots, degree).todia()

    bands = np.zeros((3 * degree + 1, count), order="F")
    bands[2 * degree - matrix.offsets, : matrix.data.shape[1]] = matrix.data
    return Spline(degree, knots, bands, np.linspace(0.0, 1.0, 8 * count))


def join_knots(knots: Array, arm: Arm) -> JointPath:
    """Join joint knots by a cubic spline, or by one without overshoot if that would exceed a limit.

    Args:
        knots: (K, J) joints.
        arm: gives the limits.
    """
    from scipy.interpolate import PchipInterpolator

    spline = prepare_spline(len(knots))
    path = spline.join(knots)

    joints = path(spline.looks)
    below = joints < arm.lower - _ROUNDING_RAD
    above = joints > arm.upper + _ROUNDING_RAD

    if (below | above).any():
        return PchipInterpolator(np.linspace(0.0, 1.0, len(knots)), knots, axis=0)

    return path


@lru_cache(maxsize=64)
def sample_cells(cells: int) -> Array:
    """Sample a path evenly, its knots among them, where curvature is largest.

    Args:
        cells: how many there are from knot to knot.

    Returns:
        Places (S,) from 0 to 1, read-only.
    """
    places = np.linspace(0.0, 1.0, cells * max(16, -(-40 // cells)) + 1)
    places.setflags(write=False)
    return places


def bend(path: JointPath, s: Array) -> Array:
    """Compute how much a path bends.

    Args:
        path: of J joints.
        s: (S,) places on it.

    Returns:
        The size of its second derivative (S, J).
    """
    from scipy.interpolate import PchipInterpolator

    after: Array = np.abs(path(s, 2))
    if not isinstance(path, PchipInterpolator):
        return after

    # Its second derivative jumps at a knot: take both sides.
    return np.maximum(after, np.abs(path(np.maximum(s - 1e-9, 0.0), 2)))

"""Find which solids of a rollout may meet, and when, by boxes around them.

It is the broad phase: what it leaves is measured exactly. It errs on one side only: solids that meet are never left
out. The steps stand in docs/physics_explained.md.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from core.geometry import Array
from core.solids.tracks import Indices, Rows, Tracks, lengths

Flags = npt.NDArray[np.bool_]

ROUNDING_M = 1e-9  # in comparisons of lengths


def neighbours(
    tracks: Tracks, margin: float, joined: Collection[frozenset[str]]
) -> Indices:
    """Pair solids of which one ever is near where the other ever is, by their boxes along the world's axes.

    Args:
        tracks: the solids at T samples.
        margin: how far apart the boxes of a pair may be, metres.
        joined: two owners each, whose solids are no pair.

    Returns:
        The numbers (P, 2) of two solids of different owners. The first one moves.
    """
    moving = tracks.solids.moving
    lowest = tracks.rows.low.min(axis=1)
    highest = tracks.rows.high.max(axis=1)
    below = lowest[moving] - margin <= highest[:, None]
    above = highest[moving] + margin >= lowest[:, None]
    near = (below & above).all(axis=2)

    # Each two solids once, also if both move.
    numbers = np.arange(len(lowest))[:, None]
    moves = np.zeros(numbers.shape, dtype=bool)
    moves[moving] = True
    once = ~moves | (numbers > moving)

    owners = tracks.solids.owners
    strangers = owners[:, None] != owners[moving]
    others, movers = np.nonzero(near & once & strangers)
    pairs = np.column_stack([moving[movers], others])

    names = owners[pairs].tolist()
    apart = [frozenset(both) not in joined for both in names]
    return pairs[np.array(apart, dtype=bool)]


def may_meet(
    tracks: Tracks,
    pairs: Indices,
    least: Array,
    within: Flags,
) -> Flags:
    """Report where two solids may get deep in each other on the way from a sample to the next.

    The boxes along the world's axes around what the solids sweep are compared first, then those along the solids' own
    axes: solids are no deeper in each other than their boxes.

    Args:
        tracks: the solids at T samples.
        pairs: (P, 2) the numbers of two solids.
        least: (P,) the depth that counts, metres; a negative one is a gap.
        within: (P, T - 1) the intervals that are looked at.

    Returns:
        In which of these intervals they may: (P, T - 1).
    """
    rows = tracks.rows
    enough = least - ROUNDING_M

    # Along z first, since most moves sideways: there in all intervals at once.
    depth = _measure_overlaps(rows, 2, pairs, slice(-1))
    met, interval = np.nonzero(within & (depth >= enough[:, None]))

    for axis in (1, 0):
        depth = _measure_overlaps(rows, axis, pairs[met], interval)
        deep = depth >= enough[met]
        met = met[deep]
        interval = interval[deep]

    first, second = pairs[met].T
    aside = rows.aside[first, interval] + rows.aside[second, interval]
    # Along the axes of either, in one call: few pairs get here, and NumPy's calls take longer than its sums.
    both = np.concatenate([first, second]), np.concatenate([second, first])
    gaps = _bound_gaps(tracks, *both, np.tile(interval, 2)).reshape(2, -1)
    deep = aside - gaps.max(axis=0) >= enough[met]

    may = np.zeros_like(within)
    may[met[deep], interval[deep]] = True
    return may


def _measure_overlaps(
    rows: Rows, axis: int, pairs: Indices, interval: Indices | slice
) -> Array:
    """Measure how far the boxes of pairs (P, 2) overlap along an axis of the world, metres, in some intervals."""
    first, second = pairs.T
    low = rows.low[..., axis]
    high = rows.high[..., axis]
    over = high[first, interval] - low[second, interval]
    under = high[second, interval] - low[first, interval]

    return np.minimum(over, under)


def _bound_gaps(
    tracks: Tracks,
    first: Indices,
    second: Indices,
    interval: Indices,
) -> Array:
    """Bound the gaps between solids from below, by boxes along the axes of the second of each two.

    In the second's frame, points of the first move straight on but for what the two turn. So the gap along an axis is
    smallest at one of the ends, less the bend of the ways: solids that slide along each other don't come nearer.

    Args:
        tracks: the solids over time.
        first: (N,) the numbers of solids.
        second: (N,) those of the others.
        interval: (N,) when each two are compared.

    Returns:
        Gaps (N,), metres.
    """
    rows = tracks.rows
    solids = tracks.solids
    ends = interval + np.array([[0], [1]])  # (2, N)
    here = first, ends
    there = second, ends

    # Where the first is, along the axes of the second.
    # A ball extends as far as its radius, however it is turned.
    back = rows.rotations[there].swapaxes(2, 3)
    middles = rows.middles[here] - rows.middles[there]
    ahead = np.einsum("knij,knj->ikn", back, middles)
    widths = np.abs(back @ rows.rotations[here])
    extents = np.einsum("knij,nj->ikn", widths, solids.halves[first])
    extents = np.minimum(extents, solids.radii[first])
    extents += solids.halves[second].T[:, None]

    # The gaps along three axes either way, (6, 2, N):
    # along the best axis, at the worse of the two ends.
    gaps = np.concatenate([ahead - extents, -ahead - extents])
    gaps = gaps.min(axis=1).max(axis=0)

    # From the straight way a point gets as far as an eighth of its acceleration,
    # in units of the interval.
    begin, end = rows.positions[here] - rows.positions[there]
    moved = lengths(end - begin)
    reach = solids.reaches[first]
    turned = rows.turned[first, interval]
    others_turned = rows.turned[second, interval]

    far = lengths(begin) + moved + reach
    bend = others_turned**2 * far + turned**2 * reach
    bend += 2 * others_turned * (moved + reach * turned)

    return gaps - bend / 8

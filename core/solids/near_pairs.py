"""Find which solids of a rollout may meet, and when, by boxes around them."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from core.geometry import Array
from core.solids.tracks import Indices, Tracks, lengths

Flags = npt.NDArray[np.bool_]

ROUNDING_M = 1e-9  # in comparisons of lengths


def neighbours(
    tracks: Tracks, margin: float = 0.0, joined: Collection[frozenset[str]] = ()
) -> Indices:
    """Pair solids (P, 2) of different owners, one of which ever is within ``margin`` metres of where the other ever is.

    At least one of them is in motion. Only their bounding boxes are compared. Owners that are ``joined`` are no pair.
    """
    if tracks.samples < 2:
        return np.empty((0, 2), dtype=np.intp)
    moving = tracks.moving
    lowest = tracks.rows.low[tracks.first]
    highest = tracks.rows.high[tracks.first]
    lowest[moving] = tracks.by_sample(tracks.rows.low).min(axis=1)
    highest[moving] = tracks.by_sample(tracks.rows.high).max(axis=1)
    below = lowest[moving] - margin <= highest[:, None]
    above = highest[moving] + margin >= lowest[:, None]
    near = (below & above).all(axis=2)

    numbers = np.arange(len(tracks))[:, None]
    once = (tracks.moves[:, None] == 0) | (numbers > moving)
    owners = tracks.solids.owner_numbers
    others, movers = np.nonzero(near & once & (owners[:, None] != owners[moving]))
    pairs = np.column_stack([moving[movers], others])
    if joined:
        names = tracks.solids.owners
        both = [frozenset((names[i], names[j])) for i, j in pairs.tolist()]
        pairs = pairs[[pair not in joined for pair in both]]

    return pairs


def may_meet(
    tracks: Tracks, pairs: Indices, least: Array, within: Flags | None = None
) -> Flags:
    """Report where solids may get as deep in each other as ``least`` (P,), from a sample to the next: (P, T - 1).

    Only intervals ``within`` (P, T - 1) are looked at; None: all. The boxes along the world's axes
    around what the solids sweep are compared first, then those along the solids' own axes: solids are no deeper in
    each other than these.
    """
    if within is None:
        within = np.ones((len(pairs), tracks.samples - 1), dtype=bool)
    rows = tracks.rows
    met, interval = np.nonzero(within)
    for axis in (2, 1, 0):  # along z first, since most moves sideways
        low = rows.low[:, axis]
        high = rows.high[:, axis]
        first = tracks.row(pairs[met, 0], interval)
        second = tracks.row(pairs[met, 1], interval)
        depth = np.minimum(high[first] - low[second], high[second] - low[first])
        deep = depth >= least[met] - ROUNDING_M
        met = met[deep]
        interval = interval[deep]

    first, second = pairs[met].T
    aside = rows.aside[tracks.row(first, interval)]
    aside += rows.aside[tracks.row(second, interval)]
    gaps = np.maximum(
        _bound_gaps(tracks, first, second, interval),
        _bound_gaps(tracks, second, first, interval),
    )
    deep = aside - gaps >= least[met] - ROUNDING_M
    may = np.zeros_like(within)
    may[met[deep], interval[deep]] = True
    return may


def _bound_gaps(
    tracks: Tracks, first: Indices, second: Indices, interval: Indices
) -> Array:
    """Bound from below the gaps (N,) between N pairs of solids in an interval each, by boxes along the second's axes.

    In the second's frame, points of the first move straight on but for what the two turn. If they do, the gap along an
    axis is a concave function of time: it is smallest at one of the ends. So solids that slide along each other don't
    come nearer.
    """
    rows = tracks.rows
    solids = tracks.solids
    ends = interval + np.array([[0], [1]])
    here = tracks.row(first, ends)  # (2, N)
    there = tracks.row(second, ends)

    # The gaps along three axes either way, (6, 2, N). A ball extends as far as its radius, however it is turned.
    back = rows.rotations[there].swapaxes(2, 3)
    middles = rows.middles[here] - rows.middles[there]
    ahead = np.einsum("knij,knj->ikn", back, middles)
    widths = np.abs(back @ rows.rotations[here])
    extents = np.einsum("knij,nj->ikn", widths, solids.halves[first])
    extents = np.minimum(extents, solids.radii[first])
    extents += solids.halves[second].T[:, None]
    gaps = np.concatenate([ahead - extents, -ahead - extents])
    gaps = gaps.min(axis=1).max(axis=0)

    # From the straight way a point gets as far as an eighth of its acceleration, in units of the interval.
    begin, end = rows.positions[here] - rows.positions[there]
    moved = lengths(end - begin)
    reach = solids.reaches[first]
    turned = rows.turned[here[0]]
    others_turned = rows.turned[there[0]]
    far = lengths(begin) + moved + reach
    bend = others_turned**2 * far + turned**2 * reach
    bend += 2 * others_turned * (moved + reach * turned)
    bounds: Array = gaps - bend / 8
    return bounds

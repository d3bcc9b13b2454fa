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
    names = tracks.solids.owners
    free = [frozenset((names[i], names[j])) not in joined for i, j in pairs.tolist()]
    return pairs[free]


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
    here = tracks.row(first, interval)
    there = tracks.row(second, interval)
    apart = rows.positions[here] - rows.positions[there]
    here_after = tracks.row(first, interval + 1)
    there_after = tracks.row(second, interval + 1)
    apart_after = rows.positions[here_after] - rows.positions[there_after]
    gaps = np.minimum(
        _box_gaps(tracks, first, second, here, there),
        _box_gaps(tracks, first, second, here_after, there_after),
    ).max(axis=0)

    # From the straight way a point gets as far as an eighth of its acceleration, in units of the interval.
    moved = lengths(apart_after - apart)
    reach = tracks.solids.reaches[first]
    turned = rows.turned[here]
    others_turned = rows.turned[there]
    far = lengths(apart) + moved + reach
    bend = others_turned**2 * far + turned**2 * reach
    bend += 2 * others_turned * (moved + reach * turned)
    return gaps - bend / 8


def _box_gaps(
    tracks: Tracks, first: Indices, second: Indices, here: Indices, there: Indices
) -> Array:
    """Measure the gaps (6, N) along the second solids' axes, either way, between N boxes in rows ``here`` and others.

    None extends farther from its middle than its radius: that of a ball, infinite for others.
    """
    rows = tracks.rows
    solids = tracks.solids
    back = rows.rotations[there].swapaxes(1, 2)
    apart = rows.middles[here] - rows.middles[there]
    ahead = np.einsum("nij,nj->in", back, apart)
    widths = np.abs(back @ rows.rotations[here])
    extents = np.einsum("nij,nj->in", widths, solids.halves[first])
    extents = np.minimum(extents, solids.radii[first]) + solids.halves[second].T
    return np.concatenate([ahead - extents, -ahead - extents])

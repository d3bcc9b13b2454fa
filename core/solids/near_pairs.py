"""Find which solids of a rollout may meet, and when, by boxes around them.

It is the broad phase: what it leaves is measured exactly. It errs on one side only: solids that meet are never left
out. The steps stand in docs/physics_explained.md.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from core.geometry import Array
from core.solids.tracks import Indices, Tracks

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
    within: Flags | bool = True,
) -> Flags:
    """Report where two solids may get deep in each other on the way from a sample to the next.

    Solids are no deeper in each other than the boxes along the world's axes around what they sweep.

    Args:
        tracks: the solids at T samples.
        pairs: (P, 2) the numbers of two solids.
        least: (P,) the depth that counts, metres; a negative one is a gap.
        within: (P, T - 1) the intervals that are looked at; True: all.

    Returns:
        In which of these intervals they may: (P, T - 1).
    """
    first, second = pairs.T
    wanted = least[:, None] - ROUNDING_M
    deep: Flags | bool = within

    # Axis by axis: in memory the axis comes first.
    for axis in range(3):
        low = tracks.rows.low[:, :-1, axis]
        high = tracks.rows.high[:, :-1, axis]
        deep = deep & (high[first] - low[second] >= wanted)
        deep &= high[second] - low[first] >= wanted

    return np.asarray(deep)

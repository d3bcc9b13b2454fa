"""Find which solids of a rollout may meet, and when, by boxes around them."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from core.geometry import Array
from core.solids.tracks import Indices, Tracks

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
    owners = tracks.solids.owner_numbers
    low, high = (
        tracks.by_sample(values) for values in (tracks.rows.low, tracks.rows.high)
    )
    lowest, highest = (
        tracks.rows.low[:, tracks.first],
        tracks.rows.high[:, tracks.first],
    )
    lowest[:, moving], highest[:, moving] = low.min(axis=2), high.max(axis=2)
    near = (lowest[:, None, moving] - margin <= highest[..., None]) & (
        highest[:, None, moving] + margin >= lowest[..., None]
    )
    once = (tracks.moves[:, None] == 0) | (np.arange(len(tracks))[:, None] > moving)
    pairs = np.argwhere(near.all(axis=0) & once & (owners[:, None] != owners[moving]))[
        :, ::-1
    ]
    pairs[:, 0] = moving[pairs[:, 0]]
    if joined:
        names = tracks.solids.owners
        pairs = pairs[
            [frozenset((names[i], names[j])) not in joined for i, j in pairs.tolist()]
        ]
    return pairs


def may_meet(tracks: Tracks, pairs: Indices, least: Array, within: Flags) -> Flags:
    """Report where solids may get as deep in each other as ``least`` (P,), from a sample to the next: (P, T - 1).

    Only intervals ``within`` (P, T - 1) are looked at, all ``pairs`` (P, 2) at once. The boxes along the world's axes
    around what the solids sweep are compared: solids are no deeper in each other than these.
    """
    rows = tracks.rows
    met, interval = np.divmod(np.flatnonzero(within), within.shape[1])
    a, b = tracks.row(pairs[met, 0], interval), tracks.row(pairs[met, 1], interval)
    deep = least[met] - ROUNDING_M
    for low, high in zip(
        rows.low[::-1], rows.high[::-1], strict=True
    ):  # along z first, since most moves sideways
        near = np.flatnonzero((high[a] - low[b] >= deep) & (high[b] - low[a] >= deep))
        met, interval, a, b, deep = (
            met[near],
            interval[near],
            a[near],
            b[near],
            deep[near],
        )
    kept = np.zeros_like(within)
    kept[met, interval] = True
    return kept

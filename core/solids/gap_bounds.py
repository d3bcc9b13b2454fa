"""Find which solids of a rollout may meet, and when, by boxes around them."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt

from core.geometry import Array
from core.solids.tracks import Indices, Tracks, lengths

Flags = npt.NDArray[np.bool_]

ROUNDING_M = 1e-9  # in comparisons of lengths
_AT_ONCE = 60_000  # pairs times intervals


def neighbours(tracks: Tracks, margin: float = 0.0, joined: Collection[frozenset[str]] = ()) -> Indices:
    """Pair solids (P, 2) of different owners, one of which ever is within ``margin`` metres of where the other ever is.

    At least one of them is in motion. Only their bounding boxes are compared. Owners that are ``joined`` are no pair.
    """
    if tracks.samples < 2:
        return np.empty((0, 2), dtype=np.intp)
    moving, owners = tracks.moving, tracks.solids.owner_numbers
    low, high = (tracks.by_sample(values) for values in (tracks.rows.low, tracks.rows.high))
    lowest, highest = tracks.rows.low[:, tracks.first], tracks.rows.high[:, tracks.first]
    lowest[:, moving], highest[:, moving] = low.min(axis=2), high.max(axis=2)
    near = (lowest[:, None, moving] - margin <= highest[..., None]) & (
        highest[:, None, moving] + margin >= lowest[..., None]
    )
    once = (tracks.moves[:, None] == 0) | (np.arange(len(tracks))[:, None] > moving)
    pairs = np.argwhere(near.all(axis=0) & once & (owners[:, None] != owners[moving]))[:, ::-1]
    pairs[:, 0] = moving[pairs[:, 0]]
    if joined:
        names = tracks.solids.owners
        pairs = pairs[[frozenset((names[i], names[j])) not in joined for i, j in pairs.tolist()]]
    return pairs


def may_meet(tracks: Tracks, pairs: Indices, least: Array, within: Flags) -> Flags:
    """Report where solids may get as deep in each other as ``least`` (P,), from a sample to the next: (P, T - 1).

    Only intervals ``within`` (P, T - 1) are looked at, all ``pairs`` (P, 2) at once. Boxes along the world's axes are
    compared first, then those along the solids' own. Along an axis that is fixed in one solid, points of the other move
    straight on, but for what the two turn, and the gap to them is a concave function of time: it is smallest at one
    of the ends. So solids that slide along each other don't come nearer.
    """
    if len(pairs) > (some := max(1, _AT_ONCE // max(within.shape[1], 1))):  # small arrays stay in the processor's cache
        parts = [slice(begin, begin + some) for begin in range(0, len(pairs), some)]
        return np.concatenate([may_meet(tracks, pairs[part], least[part], within[part]) for part in parts])
    solids, rows, intervals = tracks.solids, tracks.rows, within.shape[1]

    # Solids are no deeper in each other than their boxes along any axis.
    met, interval = np.divmod(np.flatnonzero(within), intervals)
    a, b, deep = tracks.row(pairs[met, 0], interval), tracks.row(pairs[met, 1], interval), least[met] - ROUNDING_M
    for low, high in zip(rows.low[::-1], rows.high[::-1], strict=True):  # along z first, since most moves sideways
        near = np.flatnonzero((high[a] - low[b] >= deep) & (high[b] - low[a] >= deep))
        met, interval, a, b, deep = met[near], interval[near], a[near], b[near], deep[near]

    ends, begin = with_next(met * (intervals + 1) + interval)  # each once
    end, (pair, instant) = begin + 1, np.divmod(ends, intervals + 1)
    i, j = pairs[pair].T
    k, m = tracks.row(i, instant), tracks.row(j, instant)
    turns, middles = (rows.rotations[k], rows.rotations[m]), rows.middles[k] - rows.middles[m]
    seen, mine = _along_axes(*turns, middles, *solids.halves[[i, j]], *solids.radii[[i, j]])
    apart = rows.positions[k] - rows.positions[m]
    moved, far = lengths(apart[end] - apart[begin]), lengths(apart[begin])
    far += moved
    turn, others_turn, (reaches, others_reaches) = rows.turned[a], rows.turned[b], solids.reaches[pairs[met].T]
    gaps = np.maximum(
        np.minimum(seen[:, begin], seen[:, end]).max(axis=0) - _curved(far, moved, turn, others_turn, reaches),
        np.minimum(mine[:, begin], mine[:, end]).max(axis=0) - _curved(far, moved, others_turn, turn, others_reaches),
    )
    kept = np.zeros_like(within)
    kept[met, interval] = gaps - rows.aside[a] - rows.aside[b] <= ROUNDING_M - least[met]
    return kept


def with_next(near: Indices) -> tuple[Indices, Indices]:
    """Return the rising samples ``near`` and their next ones, rising, and where in there each of ``near`` is."""
    begin = np.arange(len(near))
    begin[1:] += np.cumsum(np.diff(near) > 1)  # the sample before is not near: two more, else one
    samples = np.empty(begin[-1] + 2 if len(near) else 0, dtype=np.intp)
    samples[begin], samples[begin + 1] = near, near + 1
    return samples, begin


def _along_axes(
    rotations: Array,
    others_rotations: Array,
    apart: Array,
    halves: Array,
    others_halves: Array,
    radii: Array,
    others_radii: Array,
) -> tuple[Array, Array]:
    """The gaps (6, N) between two boxes along the second's axes, either way, and along the first's.

    None extends farther from its middle than its radius (N,): that of a ball, infinite for others.
    """
    widths = np.abs(others_rotations.swapaxes(1, 2) @ rotations)
    ahead = np.einsum("ni,nij->jn", apart, others_rotations)
    extents = np.minimum(np.einsum("nij,nj->in", widths, halves), radii) + others_halves.T
    seen = np.concatenate([ahead - extents, -ahead - extents])
    ahead = np.einsum("ni,nij->jn", apart, rotations)
    extents = np.minimum(np.einsum("ni,nij->jn", others_halves, widths), others_radii) + halves.T
    return seen, np.concatenate([ahead - extents, -ahead - extents])


def _curved(far: Array, moved: Array, turn: Array, others_turn: Array, reach: Array | float) -> Array:
    """How far points of a solid get from a straight way in the frame of another, metres, at most.

    It is an eighth of the acceleration, in units of the interval.
    """
    points = far + reach
    return (others_turn**2 * points + 2 * others_turn * (moved + reach * turn) + turn**2 * reach) / 8

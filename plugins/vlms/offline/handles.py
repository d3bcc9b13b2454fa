"""What stands out of a body on both sides, by which it can be lifted or carried."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from plugins.vlms.offline.job import Job, span
from plugins.vlms.offline.layout import solid_points

_FOOT_M = 0.004  # parts of a body that begin lower are its foot,
_STANDS_OUT_M = 0.006  # and those that stand out by more can be lifted


class Handles(NamedTuple):
    """What stands out of a body on both sides of a job's x; in the job's frame, metres.

    Attributes:
        inner: half of the body's width without it.
        outer: half of the body's width.
        low: where it begins, above the foot.
        high: where it ends.
        front: how far ahead it ends.
    """

    inner: float
    outer: float
    low: float
    high: float
    front: float


@lru_cache(maxsize=32)
def find_handles(job: Job) -> Handles | None:
    """Find what stands out of a job's bodies on both sides, above their foot; None: nothing does."""
    inside = job.frame.inverse()
    parts = []
    for name in job.want.bodies:
        for solid in job.layout.solids[name]:
            parts.append(inside.apply(solid_points(solid)))

    wide = np.array([np.abs(points[:, 1]).max() for points in parts])
    low = np.array([points[:, 2].min() for points in parts])
    foot = wide[low < _FOOT_M].max()
    stands_out = (low >= _FOOT_M) & (wide > foot + _STANDS_OUT_M)
    if not stands_out.any():
        return None

    under = low[stands_out].min()
    beside = wide[~stands_out & (low < under)].max()
    outstanding = [parts[number] for number in np.flatnonzero(stands_out)]
    least, most = span(np.concatenate(outstanding))
    if least[1] > -foot or most[1] < foot:
        return None

    return Handles(
        inner=float(beside),
        outer=float(wide.max()),
        low=float(under),
        high=float(most[2]),
        front=float(most[0]),
    )

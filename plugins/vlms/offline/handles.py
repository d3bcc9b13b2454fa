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
    into_frame = job.frame.inverse()
    parts = []
    for name in job.want.bodies:
        for solid in job.layout.solids[name]:
            parts.append(into_frame.apply(solid_points(solid)))

    # Parts of the foot, and those that stand out beyond it.
    widths = np.array([np.abs(points[:, 1]).max() for points in parts])
    heights = np.array([points[:, 2].min() for points in parts])
    is_foot = heights < _FOOT_M
    foot = widths[is_foot].max()
    is_handle = ~is_foot & (widths > foot + _STANDS_OUT_M)
    if not is_handle.any():
        return None

    handles = [parts[number] for number in np.flatnonzero(is_handle)]
    least, most = span(np.concatenate(handles))
    is_on_both_sides = least[1] <= -foot and most[1] >= foot
    if not is_on_both_sides:
        return None

    # What is below the handles, beside which a tine or an edge of a channel gets.
    low = heights[is_handle].min()
    inner = widths[~is_handle & (heights < low)].max()
    return Handles(
        inner=float(inner),
        outer=float(widths.max()),
        low=float(low),
        high=float(most[2]),
        front=float(most[0]),
    )

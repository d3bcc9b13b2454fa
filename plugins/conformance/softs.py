"""Check soft bodies: a rod bends as a formula says. An engine without them is left out."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from core.geometry import Pose
from core.scene import Elastic, Form, Rope, Soft
from plugins.conformance.cases import Case, compare
from plugins.conformance.scenery import FAR, GREY
from plugins.conformance.worlds import GRAVITY, Film


def soft(
    form: Form, elastic: Elastic, height: float, pinned: tuple[int, ...] = ()
) -> Soft:
    return Soft.make(
        "soft",
        form,
        elastic,
        Pose(np.array([FAR[0], FAR[1], height])),
        color=GREY,
        pinned=pinned,
    )


@compare
def check_soft_rod_bends() -> Iterator[Case]:
    """A rod that is clamped at two nodes sinks at its end, as Euler and Bernoulli say."""
    length = 0.3
    wide = 0.02
    count = 31
    elastic = Elastic(1000, 1e7)
    rope = Rope(((0.0, 0.0, 0.0), (length, 0.0, 0.0)), count, thickness=wide)
    free = length - length / (count - 1) / 2  # from the middle of the clamped segment
    load = elastic.density * GRAVITY * math.pi * wide**2 / 4
    stiffness = elastic.young * math.pi * wide**4 / 64
    due = 1.0 - load * free**4 / (8 * stiffness)
    what = "how high the end of a soft rod comes to rest that is clamped at 1 m, m"
    yield Case(
        what, (soft(rope, elastic, 1.0, (0, 1)),), _end, due, 0.1 * (1.0 - due), 3.0
    )


def _end(played: Film) -> float:
    """The height of the last node at the end, m."""
    return float(played.states.nodes("soft")[-1, -1, 2])

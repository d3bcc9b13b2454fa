"""Check soft bodies: a rod bends as a formula says. An engine without them is left out."""

from __future__ import annotations

import math

import numpy as np

from core.geometry import Pose
from core.interfaces import Simulator
from core.scene import Elastic, Form, Rope, Soft
from plugins.conformance.shared import near
from plugins.conformance.worlds import FAR, GRAVITY, GREY, watch


def soft(
    form: Form, elastic: Elastic, height: float, pinned: tuple[int, ...] = ()
) -> Soft:
    place = Pose(np.array([FAR[0], FAR[1], height]))
    return Soft.make("soft", form, elastic, place, color=GREY, pinned=pinned)


def check_soft_rod_bends(simulator: Simulator) -> None:
    """A rod that is clamped at two nodes sinks at its end, as Euler and Bernoulli say."""
    length = 0.3
    wide = 0.02
    count = 31
    elastic = Elastic(1000, 1e7)
    rope = Rope(((0.0, 0.0, 0.0), (length, 0.0, 0.0)), count, thickness=wide)
    rod = soft(rope, elastic, 1.0, pinned=(0, 1))
    end = watch(simulator, rod, hold_s=3.0).states.nodes("soft")[-1, -1, 2]

    free = length - length / (count - 1) / 2  # from the middle of the clamped segment
    load = elastic.density * GRAVITY * math.pi * wide**2 / 4
    stiffness = elastic.young * math.pi * wide**4 / 64
    sag = load * free**4 / (8 * stiffness)
    near(
        "how high the end of a soft rod comes to rest that is clamped at 1 m, m",
        end,
        1.0 - sag,
        0.1 * sag,
    )

"""Places among neighbours: fetch a pawn from between glasses that must not be touched.

The knob is the room between the glasses over what a funnel needs that takes in the pawn wherever it may be, and the
noise. The width of the funnel follows from both; a fork without one misses the pawn.
"""

from __future__ import annotations

import random

from tasks.ladder.bodies import write_scene
from tasks.ladder.designs import SLOT_LENGTH_M, THICK_M, flare, funnel
from tasks.ladder.pawns import RAIL_M, STEM_M, pawn, take
from tasks.ladder.rung import SURE, Rung, spread

GLASS_M = 0.02  # radius
GOAL = (0.45, -0.4)
TOLERANCE_M = 0.02
LIFT_M = 0.16


def draw(level: int, noise_m: float, rng: random.Random) -> Rung:
    mouth = funnel(noise_m, STEM_M)
    room = 1 + 0.5 / level
    aside = (mouth + THICK_M + SURE * noise_m + 0.002) * room + GLASS_M
    shoved = 2 * SURE * noise_m + SLOT_LENGTH_M + flare(mouth)
    beyond = (shoved + 0.01) * room + GLASS_M
    x = 0.5 + rng.uniform(-0.02, 0.02)
    y = rng.uniform(0.02, 0.1)
    near = rng.choice((-1, 1))  # the side on which a glass stands before the pawn
    scene = write_scene(
        "places",
        goal=GOAL,
        tolerance=TOLERANCE_M,
        pawn=pawn("pawn", x, y, "red"),
        aside=aside,
        beyond=beyond,
        near=near,
        radius=GLASS_M,
        rail_height=RAIL_M,
        spread=spread(noise_m),
    )
    return Rung(scene, *take(noise_m, [("pawn", GOAL)], LIFT_M))

"""What swings: press a button on a cart that runs to and fro, and keep it pressed.

The knobs are how far the cart swings and how fast; noise adds to both. A rail across the cart's whole way, as wide as
swing and noise ask, presses the button wherever it is. A rod meets it now and then, and loses it.
"""

from __future__ import annotations

import random

from tasks.ladder.bodies import drive, write_scene
from tasks.ladder.designs import (
    DROP_M,
    POST_M,
    THICK_M,
    bar,
    design,
    post,
    waypoint,
)
from tasks.ladder.rung import SURE, Entry, Rung, spread

MOST_SWING_M = 0.18
HEIGHT_M = 0.09  # of the button
DEEP_M = 0.015  # how far the button must be in at the end
SPARE_M = 0.004
BUTTON_M = 0.015  # half its side
FACE_M = POST_M / 2 + THICK_M - 0.001  # of the rail, before the post's axis


def draw(level: int, noise_m: float, rng: random.Random) -> Rung:
    swing = min(0.03 + 0.02 * level, MOST_SWING_M)
    period = rng.uniform(2.0, 3.0) * (1 + 1 / level)
    travel = DEEP_M + 2 * (SURE * noise_m + SPARE_M)
    x = 0.62 + rng.uniform(-0.02, 0.02)
    button_x = -(0.02 + travel + 0.008)
    scene = write_scene(
        "swing",
        swing=swing,
        period=period,
        deep=DEEP_M,
        x=x,
        height=HEIGHT_M,
        button_x=button_x,
        half_button=BUTTON_M,
        drive=drive(swing, period),
        travel=travel,
        spread=spread(noise_m),
    )
    half = swing + SURE * noise_m + BUTTON_M + 0.01
    rail = bar(
        "rail", (FACE_M - THICK_M / 2, -half), (FACE_M - THICK_M / 2, half), "post"
    )
    plan = _plan(button_x, travel, noise_m)
    return Rung(
        scene,
        design("rail", [post(), rail], plan),
        design("straight rod", [post()], plan),
    )


def _plan(button_x: float, travel: float, noise_m: float) -> list[Entry]:
    """Write the way up to the button and against it, in the track's frame as it is seen."""
    touch = button_x - 0.006 - FACE_M
    before = touch - SURE * noise_m - 0.02
    pressed = touch + (DEEP_M + travel) / 2
    height = HEIGHT_M + DROP_M
    return [
        waypoint("track", (before, 0, height + 0.1)),
        waypoint("track", (before, 0, height), speed=0.2),
        waypoint("track", (pressed, 0, height), speed=0.08, wait=0.5),
    ]

"""What swings: press a button on a cart that runs to and fro, and keep it pressed.

The knobs are how far the cart swings and how fast; noise adds to both. A rail across the cart's whole way, as wide as
swing and noise ask, presses the button wherever it is. A rod meets it now and then, and loses it.
"""

from __future__ import annotations

import random

from tasks.ladder.bodies import button, part, run
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
    scene = {
        "description": (
            f"A cart runs to and fro on a track along y, {1000 * swing:.0f} mm to each side of its middle, once in "
            f"{period:.1f} s. On its side toward the robot is a sprung button. At the end the button must be pressed "
            f"by at least {1000 * DEEP_M:.0f} mm, while the cart runs on."
        ),
        "in_words": (
            "A cart runs to and fro on a track. On its side toward the robot is a sprung button. At the end the button "
            "must be pressed, while the cart runs on."
        ),
        "bodies": [
            {
                "name": "track",
                "fixed": True,
                "position": [round(x, 4), 0, 0],
                "color": "gray",
                "parts": [part((0.02, 2 * swing + 0.06, 0.04), (0, 0, 0.02))],
            },
            {
                "name": "cart",
                "at": "track",
                "position": [0, 0, HEIGHT_M],
                "box": [0.04, 0.06, 0.06],
                "mass": 0.5,
                "color": "steelblue",
            },
            {
                "name": "button",
                "at": "track",
                "position": [round(button_x, 4), 0, HEIGHT_M],
                "box": [0.012, 2 * BUTTON_M, 2 * BUTTON_M],
                "mass": 0.03,
                "color": "red",
            },
        ],
        "joints": [
            run("run", "cart", "track", swing, period),
            button("press", "button", "cart", [1, 0, 0], travel),
        ],
        "goals": [{"joint": "press", "to": f"> {DEEP_M}"}],
        "variations": {
            "wide": {
                "bodies.track.position.x": f"+-{spread(noise_m)}",
                "bodies.track.position.y": f"+-{spread(noise_m)}",
            }
        },
    }
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

"""A gentle touch: press a sprung button on a wall far enough, and hardly harder than that.

The knob is the force that is allowed over the force that is needed; noise adds to it, since nobody sees the wall to the
millimetre, and no arm feels a tenth of a newton. So the tool measures: legs beside the button meet the wall when a bar
between them has pressed it far enough. A rod that is pushed until it is felt presses too hard.
"""

from __future__ import annotations

import random

from tasks.ladder.bodies import write_scene
from tasks.ladder.designs import (
    DROP_M,
    POST_M,
    THICK_M,
    bar,
    box,
    design,
    post,
    waypoint,
)
from tasks.ladder.rung import SURE, Entry, Rung, spread

HEIGHT_M = 0.15  # of the button
OUT_M = 0.035  # from the wall to the button's face
DEEP_M = 0.01  # how far it must be in at the end
TRAVEL_M = 0.028
STIFFNESS = 200.0  # N/m, of its spring
BUTTON_M = 0.015  # half its side
MOST_TIMES = 4.0  # the force allowed over the force needed, at level 1
LEAST_TIMES = 1.15  # the rest is damping, blows, and what gives way in a contact
SHRINKS = 0.6
SHARE = 0.3  # of the way between the least and the most, at which the gauge stops
MEETS_N = 12.0  # with which legs are pressed against the wall
SLOW_M_S = 0.01
FACE_M = POST_M / 2 + THICK_M - 0.001  # of the bar, before the post's axis


def times_at(level: int) -> float:
    """Return the force allowed over the force needed: what is allowed beyond it shrinks with each level."""
    return max(1 + (MOST_TIMES - 1) * SHRINKS ** (level - 1), LEAST_TIMES)


def draw(level: int, noise_m: float, rng: random.Random) -> Rung:
    most_n = STIFFNESS * DEEP_M * times_at(level)
    deepest_m = min(most_n / STIFFNESS, TRAVEL_M - 0.004)
    leg = OUT_M - DEEP_M - SHARE * (deepest_m - DEEP_M)
    aside = SURE * noise_m + BUTTON_M + 0.015
    scene = write_scene(
        "gentle",
        x=0.62 + rng.uniform(-0.02, 0.02),
        y=rng.uniform(-0.1, 0.1),
        half_wall=2 * aside + 0.03,
        out=OUT_M,
        height=HEIGHT_M,
        half_button=BUTTON_M,
        deep=DEEP_M,
        travel=TRAVEL_M,
        stiffness=STIFFNESS,
        most_n=most_n,
        spread=spread(noise_m),
    )
    half = aside + THICK_M
    back = FACE_M - THICK_M / 2
    gauge = [post(), bar("bar", (back, -half), (back, half), "post")]
    for name, side in (("left", 1), ("right", -1)):
        middle = (FACE_M + leg / 2 - 0.001, side * (aside + THICK_M / 2), -DROP_M)
        gauge.append(box(name, (leg + 0.002, THICK_M, THICK_M), middle, parent="bar"))

    return Rung(
        scene,
        design("gauge", gauge, _plan(FACE_M + leg, noise_m)),
        design("straight rod", [post()], _plan(POST_M / 2 + OUT_M, noise_m)),
    )


def _plan(reach: float, noise_m: float) -> list[Entry]:
    """Write the way toward the wall until what reaches so far before the post's axis is stopped."""
    before = -(reach + SURE * noise_m + 0.05)
    beyond = -reach + SURE * noise_m + 0.03
    height = HEIGHT_M + DROP_M
    feel = {"until": "force", "newtons": MEETS_N, "speed": SLOW_M_S}
    return [
        waypoint("wall", (before, 0, height + 0.1)),
        waypoint("wall", (before, 0, height), speed=0.2),
        {**waypoint("wall", (beyond, 0, height)), **feel, "wait": 0.3},
    ]

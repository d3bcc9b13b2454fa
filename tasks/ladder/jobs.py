"""One tool for several jobs: fetch a pawn, keep a button pressed on a cart that swings, press one deep in a slot.

The knob is the number of jobs, which want different heads; from level 3 on noise and the room for each head bite. The
heads are stacked on one post, each to its own side: fork below, rod above it, rail on top. Objects of a job stand so
high that the heads below clear the table, and the heads above clear what stands there.
"""

from __future__ import annotations

import math
import random

from tasks.ladder.bodies import drive, part, write_scene
from tasks.ladder.designs import (
    POST_M,
    THICK_M,
    bar,
    design,
    fork,
    funnel,
    waypoint,
)
from tasks.ladder.pawns import STEM_M, fetch, pawn
from tasks.ladder.rung import SURE, Entry, Rung

MOST_NOISE_M = 0.005  # wider heads meet each other's objects
GOAL = (0.42, -0.42)
TOLERANCE_M = 0.02
LIFT_M = 0.13
RAIL_DROP_M = 0.19
ROD_DROP_M = 0.25
ROD_M = 0.17  # from the post's axis to the rod's tip
CART_M = 0.17  # height of the button on the cart
SLOT_M = 0.12  # height of the button in the slot
DEPTH_M = 0.09  # of the slot, before its button
SWING_M = 0.04
DEEP_M = 0.012  # how far buttons must be in at the end
SPARE_M = 0.004
FACE_M = POST_M / 2 + THICK_M - 0.001


def draw(level: int, noise_m: float, rng: random.Random) -> Rung:
    room = 1 + 0.5 / level
    travel = DEEP_M + 2 * (SURE * noise_m + SPARE_M)
    mouth = funnel(noise_m, STEM_M)
    x = 0.45 + rng.uniform(-0.02, 0.02)
    red = pawn("pawn", x, -0.12 + rng.uniform(-0.01, 0.01), "red")
    gap = (THICK_M + 2 * SURE * noise_m + 0.004) * room
    slot = _slot(gap, travel) if level > 1 else []
    parts = fork(mouth)
    plan = fetch("pawn", GOAL, noise_m, mouth, LIFT_M)
    if slot:
        parts.append(bar("rod", (0, 0), (0, ROD_M), "post", drop=ROD_DROP_M))
        plan += _push(travel, noise_m)

    period = rng.uniform(2.0, 3.0)
    half = SWING_M + SURE * noise_m + 0.025
    behind = -FACE_M + THICK_M / 2
    parts.append(bar("rail", (-half, behind), (half, behind), "post", drop=RAIL_DROP_M))
    plan += _keep(travel, noise_m)
    scene = write_scene(
        "jobs",
        goal=GOAL,
        tolerance=TOLERANCE_M,
        deep=DEEP_M,
        pawn=red,
        slot=slot,
        slot_height=SLOT_M,
        gap=gap,
        height=CART_M,
        travel=travel,
        swing=SWING_M,
        drive=drive(SWING_M, period),
    )
    return Rung(
        scene, design("stack", parts, plan), design("fork alone", fork(mouth), plan)
    )


def _slot(gap: float, travel: float) -> list[Entry]:
    """Write two walls along y, and one that closes them at their far end."""
    long = DEPTH_M + travel + 0.03
    wall = 0.02
    tall = SLOT_M + 0.03
    parts: list[Entry] = []
    for side in (-1, 1):
        place = [side * (gap + wall) / 2, long / 2, tall / 2]
        parts.append(part([wall, long, tall], place))

    parts.append(part([gap + 2 * wall, wall, tall], [0, long + wall / 2, tall / 2]))
    return parts


def _push(travel: float, noise_m: float) -> list[Entry]:
    """Write how the rod presses the button in the slot, and comes back."""
    height = SLOT_M + ROD_DROP_M
    touch = DEPTH_M - 0.005 - ROD_M
    before = -ROD_M - SURE * noise_m - 0.02
    pressed = touch + (DEEP_M + travel) / 2
    return [
        waypoint("slot", (0, before, height + 0.1)),
        waypoint("slot", (0, before, height), speed=0.2),
        waypoint("slot", (0, pressed, height), speed=0.12),
        waypoint("slot", (0, before, height), speed=0.2),
        waypoint("slot", (0, before, height + 0.1)),
    ]


def _keep(travel: float, noise_m: float) -> list[Entry]:
    """Write how the rail, turned to the cart, presses its button and stays."""
    turned = round(math.pi / 2, 4)
    height = CART_M + RAIL_DROP_M
    touch = -(0.028 + travel) - 0.006 - FACE_M
    before = touch - SURE * noise_m - 0.03
    pressed = touch + (DEEP_M + travel) / 2
    return [
        waypoint("track", (before, 0, height + 0.1), turned),
        waypoint("track", (before, 0, height), turned, speed=0.2),
        waypoint("track", (pressed, 0, height), turned, speed=0.08, wait=0.5),
    ]

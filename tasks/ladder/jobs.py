"""One tool for several jobs: fetch a pawn, keep a button pressed on a cart that swings, press one deep in a slot.

The knob is the number of jobs, which want different heads; from level 3 on noise and the room for each head bite. The
heads are stacked on one post, each to its own side: fork below, rod above it, rail on top. Objects of a job stand so
high that the heads below clear the table, and the heads above clear what stands there.
"""

from __future__ import annotations

import math
import random

from tasks.ladder.bodies import button, mark, part, run
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
    bodies = [pawn("pawn", x, -0.12 + rng.uniform(-0.01, 0.01), "red")]
    goals: list[Entry] = [
        {
            "bodies": ["pawn"],
            "place": [*GOAL, None],
            "tolerance": TOLERANCE_M,
            "released": True,
            "rest": True,
            "also": [{"axis": [0, 0, 1], "tolerance_deg": 10}],
        }
    ]
    said = ["carry the red pawn to the middle of the green mark and let it stand there"]
    parts = fork(mouth)
    plan = fetch("pawn", GOAL, noise_m, mouth, LIFT_M)
    joints: list[Entry] = []
    if level > 1:
        gap = (THICK_M + 2 * SURE * noise_m + 0.004) * room
        bodies += _slot(gap, travel)
        joints.append(button("push", "deep", "slot", [0, 1, 0], travel))
        goals.append({"joint": "push", "to": f"> {DEEP_M}", "ever": True})
        said.append("press the green button deep in the slot once")
        parts.append(bar("rod", (0, 0), (0, ROD_M), "post", drop=ROD_DROP_M))
        plan += _push(travel, noise_m)

    period = rng.uniform(2.0, 3.0)
    bodies += _cart(travel)
    joints += [
        run("run", "cart", "track", SWING_M, period),
        button("press", "button", "cart", [1, 0, 0], travel),
    ]
    goals.append({"joint": "press", "to": f"> {DEEP_M}"})
    said.append(
        "press the blue button on the cart that runs to and fro, and keep it pressed to the end"
    )
    half = SWING_M + SURE * noise_m + 0.025
    behind = -FACE_M + THICK_M / 2
    parts.append(bar("rail", (-half, behind), (half, behind), "post", drop=RAIL_DROP_M))
    plan += _keep(travel, noise_m)
    scene = {
        "description": (
            f"{len(said)} jobs for one tool: {'; '.join(said)}. The mark is at ({GOAL[0]:g}, {GOAL[1]:g}), the pawn "
            f"must stand within {1000 * TOLERANCE_M:.0f} mm of it, and a button counts from {1000 * DEEP_M:.0f} mm on."
        ),
        "in_words": f"Jobs for one tool: {'; '.join(said)}.",
        "marks": [mark(GOAL)],
        "bodies": bodies,
        "joints": joints,
        "every": True,
        "goals": goals,
        "variations": {
            "wide": {
                "bodies.pawn.position.x": "+-0.01",
                "bodies.track.position.x": "+-0.01",
                "bodies.track.position.y": "+-0.01",
            }
        },
    }
    return Rung(
        scene, design("stack", parts, plan), design("fork alone", fork(mouth), plan)
    )


def _slot(gap: float, travel: float) -> list[Entry]:
    """Write two walls along y, and a button between them at their far end."""
    long = DEPTH_M + travel + 0.03
    wall = 0.02
    tall = SLOT_M + 0.03
    parts: list[Entry] = []
    for side in (-1, 1):
        place = [side * (gap + wall) / 2, long / 2, tall / 2]
        parts.append(part([wall, long, tall], place))

    parts.append(part([gap + 2 * wall, wall, tall], [0, long + wall / 2, tall / 2]))
    slot = {
        "name": "slot",
        "fixed": True,
        "position": [0.46, 0.14, 0],
        "color": "lightgray",
        "parts": parts,
    }
    deep = {
        "name": "deep",
        "at": "slot",
        "position": [0, round(DEPTH_M, 4), SLOT_M],
        "box": [round(0.8 * gap, 4), 0.01, 0.03],
        "mass": 0.03,
        "color": "green",
    }
    return [slot, deep]


def _cart(travel: float) -> list[Entry]:
    """Write a track on legs, a cart on it, and a button on the cart's side toward the robot."""
    track = {
        "name": "track",
        "fixed": True,
        "position": [0.7, 0, 0],
        "color": "gray",
        "parts": [part([0.02, 0.16, 0.02], [0, 0, CART_M - 0.05])],
    }
    cart = {
        "name": "cart",
        "at": "track",
        "position": [0, 0, CART_M],
        "box": [0.04, 0.05, 0.06],
        "mass": 0.5,
        "color": "steelblue",
    }
    blue = {
        "name": "button",
        "at": "track",
        "position": [round(-(0.028 + travel), 4), 0, CART_M],
        "box": [0.012, 0.03, 0.03],
        "mass": 0.03,
        "color": "blue",
    }
    return [track, cart, blue]


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

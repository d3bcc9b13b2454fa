"""Crowded sorting: pawns in a row, red ones to the left and blue ones to the right, with one plan.

The knob is the distance of two pawns over what a fork needs that takes in each wherever it may be; from level 3 on
there are more of them. A fork with a funnel of that width does it, outer pawns first; one without a funnel misses.
"""

from __future__ import annotations

import random

from tasks.ladder.bodies import write_scene
from tasks.ladder.designs import THICK_M, funnel
from tasks.ladder.pawns import BASE_M, RAIL_M, STEM_M, pawn, take
from tasks.ladder.rung import SURE, Rung, spread

ZONE_X_M = 0.45
RAIL_Y_M = 0.31
PLACES_Y_M = (0.48, 0.37)  # of the first and the second pawn of a zone
ROW_X_M = 0.54
LIFT_M = 0.12


def draw(level: int, noise_m: float, rng: random.Random) -> Rung:
    count = min(2 + (level - 1) // 2, 4)
    mouth = funnel(noise_m, STEM_M)
    needed = mouth + THICK_M + STEM_M + SURE * noise_m
    apart = max(needed * (1 + 0.5 / level), 2 * BASE_M + 0.012)

    colors = ["red", "blue"] * 2
    colors = colors[:count]
    rng.shuffle(colors)
    x = ROW_X_M + rng.uniform(-0.02, 0.02)
    bodies = []
    for number, color in enumerate(colors):
        y = (number - (count - 1) / 2) * apart
        bodies.append(pawn(f"{color}_{number}", x, y, color))

    outer_first = sorted(bodies, key=lambda body: -abs(body["position"][1]))
    names = [body["name"] for body in outer_first]
    # The others stand by the first, and move with it from layout to layout.
    first, *others = bodies
    begin = first["position"][1]
    for body in others:
        body["at"] = first["name"]
        body["position"] = [0, round(body["position"][1] - begin, 4), 0]

    free = max(RAIL_Y_M - abs(begin) - BASE_M - 0.02, 0.004)

    scene = write_scene(
        "sort",
        pawns=bodies,
        apart=apart,
        rail_y=RAIL_Y_M,
        rail_height=RAIL_M,
        zone_x=ZONE_X_M,
        spread=spread(noise_m),
        aside=min(spread(noise_m), round(free, 4)),
    )
    return Rung(scene, *take(noise_m, _list_jobs(names), LIFT_M))


def _list_jobs(names: list[str]) -> list[tuple[str, tuple[float, float]]]:
    """Say where each pawn goes: the first of a color to the far side of its zone."""
    jobs = []
    taken = {"red": 0, "blue": 0}
    for name in names:
        color = name.partition("_")[0]
        side = 1 if color == "red" else -1
        jobs.append((name, (ZONE_X_M, side * PLACES_Y_M[taken[color]])))
        taken[color] += 1

    return jobs

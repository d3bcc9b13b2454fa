"""Places among neighbours: fetch a pawn from between glasses that must not be touched.

The knob is the room between the glasses over what a funnel needs that takes in the pawn wherever it may be, and the
noise. The width of the funnel follows from both; a fork without one misses the pawn.
"""

from __future__ import annotations

import random

from tasks.ladder.bodies import mark
from tasks.ladder.designs import SLOT_LENGTH_M, THICK_M, flare, funnel
from tasks.ladder.pawns import STEM_M, pawn, rail, take
from tasks.ladder.rung import SURE, Entry, Rung, spread

GLASS_M = 0.02  # radius
GLASS_HEIGHT_M = 0.11
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
    glasses = [
        _glass("glass_1", 0, aside),
        _glass("glass_2", 0, -aside),
        _glass("glass_3", beyond, 0),
        _glass("glass_4", -0.08, near * aside),
    ]
    scene = {
        "description": (
            "A red pawn stands on the table between four glasses, one of them behind it. Carry it over the rail to "
            f"the green mark at ({GOAL[0]:g}, {GOAL[1]:g}), where it must stand upright, within "
            f"{1000 * TOLERANCE_M:.0f} mm, and be let go. The robot must touch no glass, and none may be moved."
        ),
        "in_words": (
            "A red pawn stands on the table between four glasses, one of them behind it. Carry it over the rail to the "
            "middle of the green mark, where it must stand upright and be let go. The robot must touch no glass, and "
            "none may be moved."
        ),
        "marks": [mark(GOAL)],
        "bodies": [pawn("pawn", x, y, "red"), *glasses, rail("rail", -0.31, 0.4)],
        "goals": [
            {
                "bodies": ["pawn"],
                "place": [*GOAL, None],
                "tolerance": TOLERANCE_M,
                "released": True,
                "rest": True,
                "also": [{"axis": [0, 0, 1], "tolerance_deg": 10}],
            },
            {"untouched": ["glass_*"]},
            {"keep": ["glass_*"]},
        ],
        "variations": {
            "wide": {
                "bodies.pawn.position.x": "+-0.005",
                "bodies.pawn.position.y": f"+-{spread(noise_m)}",
                "bodies.glass_*.position.x": "+-0.005",
            }
        },
    }
    return Rung(scene, *take(noise_m, [("pawn", GOAL)], LIFT_M))


def _glass(name: str, x: float, y: float) -> Entry:
    """Write a glass that stands by the pawn, and moves with it from layout to layout."""
    return {
        "name": name,
        "at": "pawn",
        "cylinder": {"radius": GLASS_M, "length": GLASS_HEIGHT_M},
        "position": [round(x, 4), round(y, 4), GLASS_HEIGHT_M / 2],
        "mass": 0.15,
        "friction": 0.4,
        "color": "lightblue",
    }

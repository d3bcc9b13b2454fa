"""Little material, long reach: draw a block near with a tool that may weigh hardly more than the lightest one known.

The knob is what the tool may weigh: at level 1 half as much again as the reference, and 4.5 % less with each
level. The reference is a hook whose shaft is thinner toward its end, as bending asks. From the level on at which it is
too heavy, nobody knows whether the scene can be solved: a lighter tool is the next reference.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

from tasks.ladder.bodies import write_scene
from tasks.ladder.designs import SLOW_M_S, box, design, waypoint
from tasks.ladder.rung import SURE, Entry, Rung, spread

TILT_RAD = math.radians(60)  # of the shaft, outward from straight down
HOME_DEG = -60  # of the arm at home
SECTIONS_M = (0.0099, 0.0089, 0.0079, 0.0066)  # sides of the shaft, from the flange on
SHAFT_M = 0.28
HOOK_M = 0.07
THIN_M = 0.0056  # side of the hook
BLOCK_M = (0.06, 0.08, 0.05)
BLOCK_X_M = 1.02
NEAR_M = 0.8  # where it must end, at most
REFERENCE_KG = 0.0168  # with the default material
MOST_TIMES = 1.5  # what may be weighed over that, at level 1
SHRINKS = 0.955
MOST_NOISE_M = 0.002


def payload_at(level: int) -> float:
    """Return what a tool may weigh, kg."""
    return REFERENCE_KG * MOST_TIMES * SHRINKS ** (level - 1)


def draw(level: int, noise_m: float, rng: random.Random) -> Rung:
    scene = write_scene(
        "slender",
        payload=payload_at(level),
        x=BLOCK_X_M,
        y=rng.uniform(-0.1, 0.1),
        block=BLOCK_M,
        near=NEAR_M,
        tilt=HOME_DEG,
        spread=spread(noise_m),
    )
    hook = box(
        "hook",
        (HOOK_M, THIN_M, THIN_M),
        _hook_place(),
        parent=f"shaft_{len(SECTIONS_M)}",
    )
    plan = _plan(noise_m)
    return Rung(
        scene,
        design("tapered hook", [*_shaft(SECTIONS_M), hook], plan),
        design("straight rod", _shaft(SECTIONS_M), plan),
    )


def _shaft(sections: Sequence[float]) -> list[Entry]:
    """Write a shaft of equally long sections."""
    length = SHAFT_M / len(sections)
    parts = []
    parent = "tool_mount"
    for number, side in enumerate(sections, 1):
        name = f"shaft_{number}"
        middle = (0, 0, -(number - 0.5) * length)
        parts.append(box(name, (side, side, length), middle, parent=parent))
        parent = name

    return parts


def _hook_place() -> tuple[float, float, float]:
    return (-(HOOK_M - THIN_M) / 2, 0.0, -SHAFT_M - THIN_M / 2)


def _plan(noise_m: float) -> list[Entry]:
    """Write the way over the block, behind it, and back."""
    out = SHAFT_M * math.sin(TILT_RAD)
    down = SHAFT_M * math.cos(TILT_RAD)
    height = down + HOOK_M * math.sin(TILT_RAD) + 0.01
    behind = BLOCK_M[0] / 2 + 0.05 + SURE * noise_m - out
    pulled = NEAR_M - BLOCK_X_M - 0.07 + behind
    turned = [0.0, -TILT_RAD, 0.0]

    def go(x: float, z: float, **pace: float) -> Entry:
        return {**waypoint("block", (x, 0, z), **pace), "rpy": turned}

    return [
        go(behind, height + 0.12),
        go(behind, height, speed=0.2),
        go(pulled, height, speed=SLOW_M_S),
    ]

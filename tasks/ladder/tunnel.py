"""Arcs and narrow ways: press a button at the end of a tunnel that is bent into a part of a circle.

The knobs are the angle of the arc, and the tunnel's gap over what a rod needs that is off by as much as is seen. A rod
bent into the same arc does it, turned about the circle's middle; a straight one meets the wall.
"""

from __future__ import annotations

import math
import random

from tasks.ladder.bodies import part, write_scene
from tasks.ladder.designs import THICK_M, bar, box, design, post, waypoint
from tasks.ladder.rung import SURE, Entry, Rung

MOST_NOISE_M = 0.005  # a wider tunnel lets a straight rod through
MOST_DEG = 115  # beyond, the rod's root begins where the tunnel ends
RADIUS_M = 0.16
HEIGHT_M = 0.06  # of the tunnel's middle
WALL_M = 0.01
DEEP_M = 0.015  # how far the button must go
SPARE_M = 0.004  # beyond that
PIECE_RAD = 0.16  # of the rod and of the tunnel, which are polygons
ROUND_M = (
    0.006  # of the gap, for corners and sides of these, and for what the arm misses
)
DROP_M = 0.3
SPOKE_M = 0.255  # of the arm from the post to the arc, below the flange


def draw(level: int, noise_m: float, rng: random.Random) -> Rung:
    angle = math.radians(min(60 + 10 * level, MOST_DEG) + rng.uniform(-5, 5))
    gap = (THICK_M + 2 * SURE * noise_m + ROUND_M) * (1 + 0.5 / level)
    x = 0.5 + rng.uniform(-0.02, 0.02)
    button_at = angle / 2 + 0.08
    travel = DEEP_M + 2 * (SURE * noise_m + SPARE_M)
    scene = write_scene(
        "tunnel",
        degrees=math.degrees(angle),
        gap=gap,
        deep=DEEP_M,
        x=x,
        walls=_walls(angle, gap, travel),
        button_place=_around(button_at),
        button_deg=math.degrees(button_at),
        height=HEIGHT_M,
        travel=travel,
    )
    reach = angle + 0.3 + travel / RADIUS_M
    return Rung(
        scene,
        design("arc", _arc(reach), _turn(angle, travel)),
        design("straight rod", _rod(), _push(angle)),
    )


def _around(turn: float, radius: float = RADIUS_M) -> list[float]:
    """Return where the circle is at a turn from x, (x, y)."""
    return [round(radius * math.cos(turn), 4), round(radius * math.sin(turn), 4)]


def _walls(angle: float, gap: float, travel: float) -> list[Entry]:
    """Write the tunnel's walls, floor and roof, and the plate that closes it behind the button."""
    count = math.ceil(angle / PIECE_RAD)
    step = angle / count
    side = gap / 2 + WALL_M / 2
    end = angle / 2 + 0.08 + (travel + 0.012) / RADIUS_M
    turns = [-angle / 2 + (number + 0.5) * step for number in range(count)]
    spans = [step] * count
    turns.append((angle / 2 + end) / 2)
    spans.append(end - angle / 2)
    parts = []
    for turn, span in zip(turns, spans, strict=True):
        for radius in (RADIUS_M - side, RADIUS_M + side):
            length = (radius + WALL_M) * span + 0.002
            size = (WALL_M, length, gap + 2 * WALL_M)
            parts.append(_part(size, _around(turn, radius), HEIGHT_M, turn))

        length = (RADIUS_M + side) * span
        for height in (HEIGHT_M - side, HEIGHT_M + side):
            size = (gap + 2 * WALL_M, length, WALL_M)
            parts.append(_part(size, _around(turn), height, turn))

    wide = gap + 2 * WALL_M
    parts.append(_part((wide, WALL_M, wide), _around(end), HEIGHT_M, end))
    return parts


def _part(
    size: tuple[float, float, float], place: list[float], height: float, turn: float
) -> Entry:
    rpy_deg = [0, 0, round(math.degrees(turn), 2)]
    return {**part(size, (*place, height)), "rpy_deg": rpy_deg}


def _arc(reach: float) -> list[Entry]:
    """Write a rod bent about the post's axis: its tip at a turn of 0, its root ``reach`` before, carried by a spoke."""
    count = math.ceil(reach / PIECE_RAD)
    corners = [_around(-reach * number / count) for number in range(count + 1)]
    root = corners[-1]
    spoke = bar("spoke", (0, 0), (root[0], root[1]), "post", 0.02, SPOKE_M)
    tall = DROP_M - SPOKE_M + THICK_M / 2
    drop = box(
        "drop",
        (0.014, 0.014, tall),
        (*root, -SPOKE_M - tall / 2),
        -reach,
        "spoke",
    )
    parts = [post(SPOKE_M), spoke, drop]
    parent = "drop"
    for number in range(count, 0, -1):
        start = (corners[number][0], corners[number][1])
        end = (corners[number - 1][0], corners[number - 1][1])
        parts.append(bar(f"arc_{number}", start, end, parent))
        parent = f"arc_{number}"

    return parts


def _turn(angle: float, travel: float) -> list[Entry]:
    """Write the turn about the circle's middle, from before the tunnel's mouth until the button is pressed."""
    begin = -angle / 2 - 0.12
    pressed = (DEEP_M + travel) / 2 - 0.005  # half of the button is before its middle
    end = angle / 2 + 0.08 + pressed / RADIUS_M
    height = HEIGHT_M + DROP_M
    plan = [
        waypoint("tunnel", (0, 0, height + 0.14), round(begin, 4)),
        waypoint("tunnel", (0, 0, height), round(begin, 4)),
    ]
    steps = math.ceil((end - begin) / 0.4)
    for number in range(1, steps + 1):
        turn = begin + (end - begin) * number / steps
        plan.append(waypoint("tunnel", (0, 0, height), round(turn, 4), seconds=1.2))

    return plan


def _rod() -> list[Entry]:
    """Write a straight rod that would reach the button if the way were straight."""
    return [post(), bar("rod", (0, 0), (0.22, 0), "post")]


def _push(angle: float) -> list[Entry]:
    """Write a push into the tunnel's mouth, along it."""
    begin = -angle / 2
    yaw = begin + math.pi / 2
    mouth = _around(begin)
    height = HEIGHT_M + DROP_M
    plan = []
    for back, above in ((0.26, 0.1), (0.26, 0.0), (0.1, 0.0)):
        x = mouth[0] - back * math.cos(yaw)
        y = mouth[1] - back * math.sin(yaw)
        place = (x, y, height + above)
        plan.append(waypoint("tunnel", place, round(yaw, 4), speed=0.15))

    return plan

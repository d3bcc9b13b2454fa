"""Write parts of bodies, and joints: sliders, sprung buttons and carts that run to and fro."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tasks.ladder.rung import Entry

SAMPLES = 16  # of a swing


def part(size: Sequence[float], place: Sequence[float]) -> Entry:
    """Write a box that is a part of a body: its sides, the place of its middle."""
    return {
        "box": [round(side, 4) for side in size],
        "position": [round(number, 4) for number in place],
    }


def mark(place: Sequence[float]) -> Entry:
    """Write a mark on the table where something is to stand, which nothing touches."""
    position = [*place, 0.001]
    return {"name": "place", "radius": 0.03, "position": position, "color": "green"}


def slider(
    name: str, body: str, parent: str, axis: list[float], upper: float, **more: float
) -> Entry:
    """Write a joint along an axis, from 0 to ``upper``; ``more``: such as its friction."""
    return {
        "name": name,
        "kind": "slider",
        "body": body,
        "parent": parent,
        "axis": axis,
        "lower": 0,
        "upper": round(upper, 4),
        **more,
    }


def button(
    name: str, body: str, parent: str, axis: list[float], travel: float
) -> Entry:
    """Write the joint of a button that a spring holds out."""
    return slider(name, body, parent, axis, travel, stiffness=60, damping=1.0)


def run(name: str, body: str, parent: str, swing: float, period: float) -> Entry:
    """Write the joint of a cart that runs along y by ``swing`` to each side, once in ``period`` seconds."""
    turns = [math.tau * number / SAMPLES for number in range(SAMPLES + 1)]
    drive = {
        "times": [round(period * turn / math.tau, 4) for turn in turns],
        "positions": [round(swing * math.sin(turn), 4) for turn in turns],
        "force": 60,
        "repeats": True,
    }
    joint = slider(name, body, parent, [0, 1, 0], swing + 0.01)
    return {**joint, "lower": round(-swing - 0.01, 4), "drive": drive}

"""Write scenes by their templates, parts of bodies, and what drives a cart to and fro."""

from __future__ import annotations

import math
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

from core.support.templates import fill_yaml
from tasks.ladder.rung import Entry

SAMPLES = 16  # of a swing


def write_scene(family: str, **numbers: Any) -> Entry:
    """Write the scene of a family: its template, ``scenes/FAMILY.yaml.j2``, with numbers filled in."""
    file = files(__package__) / "scenes" / f"{family}.yaml.j2"
    scene: Entry = fill_yaml(file.read_text("utf-8"), **numbers)
    return scene


def part(size: Sequence[float], place: Sequence[float]) -> Entry:
    """Write a box that is a part of a body: its sides, the place of its middle."""
    return {
        "box": [round(side, 4) for side in size],
        "position": [round(number, 4) for number in place],
    }


def drive(swing: float, period: float) -> Entry:
    """Write what drives a cart by ``swing`` to each side, once in ``period`` seconds."""
    turns = [math.tau * number / SAMPLES for number in range(SAMPLES + 1)]
    return {
        "times": [round(period * turn / math.tau, 4) for turn in turns],
        "positions": [round(swing * math.sin(turn), 4) for turn in turns],
        "force": 60,
        "repeats": True,
    }

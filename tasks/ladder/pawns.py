"""Pawns that a fork takes by the stem below their heads: their body, and the plan that brings one elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

from tasks.ladder.designs import (
    DROP_M,
    NARROW_M,
    NECK_M,
    POST_M,
    SLOT_LENGTH_M,
    SLOW_M_S,
    THICK_M,
    design,
    flare,
    fork,
    funnel,
    join,
    post,
    waypoint,
)
from tasks.ladder.rung import SURE, Entry

BASE_M = 0.025  # radius
STEM_M = 0.006  # radius
HEAD_M = 0.02  # radius
UNDER_HEAD_M = 0.066
HEIGHT_M = 0.076
TAKE_M = 0.032  # at which height a fork takes the stem
HANGS_M = DROP_M - THICK_M / 2 + UNDER_HEAD_M  # from the flange down to a pawn's foot


def pawn(name: str, x: float, y: float, color: str) -> Entry:
    """Write a pawn that stands on the table."""
    base_m = 0.016
    stem_m = UNDER_HEAD_M - base_m
    head_m = HEIGHT_M - UNDER_HEAD_M
    parts = []
    bottom = 0.0
    for radius, length in ((BASE_M, base_m), (STEM_M, stem_m), (HEAD_M, head_m)):
        shape = {"radius": radius, "length": length}
        middle = round(bottom + length / 2, 4)
        parts.append({"cylinder": shape, "position": [0, 0, middle]})
        bottom += length

    return {
        "name": name,
        "position": [round(x, 4), round(y, 4), 0.0001],
        "mass": 0.1,
        "friction": 0.4,
        "color": color,
        "parts": parts,
    }


RAIL_M = 0.02  # over which no pawn is pushed
RIGHT_M = 0.005  # a fork without a funnel still takes in what is seen so far off


def take(
    noise_m: float, jobs: Sequence[tuple[str, tuple[float, float]]], lift: float
) -> tuple[Entry, Entry]:
    """Write the design that brings pawns to places, and the simpler one: a fork that misses, or a rod that pushes.

    Args:
        noise_m: how far off pawns are seen.
        jobs: the name of each pawn, and where it is to stand, in order.
        lift: how high it is carried, m.
    """
    mouth = funnel(noise_m, STEM_M)
    plan = join(fetch(*job, noise_m, mouth, lift) for job in jobs)
    reference = design("funnel", fork(mouth), plan)
    if noise_m <= RIGHT_M:
        pushes = join(push(*job) for job in jobs)
        return reference, design("straight rod", [post()], pushes)

    narrow = join(fetch(*job, noise_m, NARROW_M, lift) for job in jobs)
    return reference, design("narrow fork", fork(NARROW_M, NARROW_M), narrow)


def push(name: str, goal: tuple[float, float]) -> list[Entry]:
    """Write the waypoints that push a pawn along y to a place."""
    side = 1 if goal[1] > 0 else -1
    beside = -side * (POST_M / 2 + STEM_M + 0.01)
    low = DROP_M + THICK_M / 2 + RAIL_M + 0.004
    return [
        waypoint(name, (0, beside, low + 0.15)),
        waypoint(name, (0, beside, low), speed=0.2),
        waypoint("world", (goal[0], goal[1] + beside, low), speed=SLOW_M_S),
        waypoint("world", (goal[0], goal[1] + beside, low + 0.15)),
    ]


def fetch(
    name: str, goal: tuple[float, float], noise_m: float, mouth: float, lift: float
) -> list[Entry]:
    """Write the waypoints that take a pawn, carry it at a height over all else, and let it stand at a place (x, y).

    The fork drives on until the stem is at the end of its slot wherever it was.
    """
    length = NECK_M + SLOT_LENGTH_M + flare(mouth)
    before = -(length + STEM_M + SURE * noise_m + 0.015)
    behind = 1.7 * SURE * noise_m - NECK_M - STEM_M + 0.003
    low = TAKE_M + DROP_M
    up = low + lift
    x = goal[0] - NECK_M - STEM_M
    stand = HANGS_M + 0.002
    out = x - SLOT_LENGTH_M - flare(mouth) - 0.03
    return [
        waypoint(name, (before, 0, up)),
        waypoint(name, (before, 0, low)),
        waypoint(name, (behind, 0, low), speed=SLOW_M_S),
        waypoint(name, (behind, 0, up), speed=0.25),
        waypoint("world", (x, goal[1], up), speed=0.2),
        waypoint("world", (x, goal[1], stand), speed=0.2, wait=0.2),
        waypoint("world", (x, goal[1], low), speed=0.1, wait=0.2),
        waypoint("world", (out, goal[1], low), speed=SLOW_M_S),
        waypoint("world", (out, goal[1], up)),
    ]

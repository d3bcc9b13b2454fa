"""Chains of jobs: a chest with a sliding lid and a bolt, from which a pawn is taken, and which is shut again.

The knob is the number of jobs, which share a space: each must leave room for the next. From level 6 on, what may be off
at the end shrinks. One fork fits knobs, bolt and pawn; each job's own motion is joined to the next one's.
"""

from __future__ import annotations

import math
import random

from tasks.ladder.bodies import part, write_scene
from tasks.ladder.designs import (
    DROP_M,
    NECK_M,
    SLOT_LENGTH_M,
    SLOT_M,
    SLOW_M_S,
    design,
    flare,
    fork,
    join,
    post,
    waypoint,
)
from tasks.ladder.pawns import fetch, pawn, push
from tasks.ladder.rung import SURE, Entry, Rung

MOST_NOISE_M = 0.004  # a wider funnel does not fit into the chest
LEVELS = (
    ("lid", "out"),
    ("lid", "out", "shut"),
    ("bolt", "lid", "out"),
    ("bolt", "lid", "out", "shut"),
    ("bolt", "lid", "out", "shut", "lock"),
)
"""The jobs of the first levels; later ones have those of the last."""

SAY = {
    "bolt": "slide the red bolt away from the robot",
    "lid": "slide the lid open by its knob",
    "out": "take the gold pawn out and stand it on the green mark",
    "shut": "shut the lid",
    "lock": "slide the bolt back",
}
HALF_M = (0.16, 0.08)  # of the chest, along x and y
WALL_M = 0.01
HEIGHT_M = 0.1
TAB_M = 0.176  # of the lid's tab and the bolt, along x
PLATE_M = 0.0725  # half the lid's width, along y
OPEN_M = 0.18
UNBOLTED_M = 0.062
KNOB_M = 0.006  # half the side of a knob
KNOB_ABOVE_M = 0.03  # of where a fork takes it
GOAL = (0.45, -0.36)
LIFT_M = 0.17


def draw(level: int, noise_m: float, rng: random.Random) -> Rung:
    jobs = LEVELS[min(level, len(LEVELS)) - 1]
    room = 1 + 1.0 / level
    off = 2 * SURE * noise_m + 0.008 * room  # of a joint at the end
    place = 0.01 + 0.01 * room  # of the pawn at the end
    x = 0.46 + rng.uniform(-0.01, 0.01)
    y = rng.uniform(-0.01, 0.02)
    bolt_y = PLATE_M + off + 0.013  # a lid that is hardly open leaves the bolt its way
    scene = write_scene(
        "chain",
        jobs=jobs,
        listed=", ".join(SAY[job] for job in jobs),
        goal=GOAL,
        tolerance=place,
        off=off,
        x=x,
        y=y,
        chest=_chest("bolt" in jobs, bolt_y),
        gold={**pawn("gold", 0.04, 0.0, "gold"), "at": "chest"},
        tab=TAB_M,
        bolt_y=bolt_y,
    )
    mouth = 2 * SURE * noise_m + KNOB_M + 0.002
    plan = join(_steps(job, noise_m, mouth, off) for job in jobs)
    return Rung(
        scene,
        design("fork", fork(mouth), plan),
        design("straight rod", [post()], push("gold", GOAL)),
    )


def _chest(bolted: bool, bolt_y: float) -> list[Entry]:
    """Write the chest's walls, and what the bolt slides on."""
    long, wide = HALF_M
    wall = WALL_M / 2
    middle = HEIGHT_M / 2
    short = 2 * (wide - WALL_M)
    parts = []
    for end in (1, -1):
        across = (0, end * (wide - wall), middle)
        along = (end * (long - wall), 0, middle)
        parts.append(part((2 * long, WALL_M, HEIGHT_M), across))
        parts.append(part((WALL_M, short, HEIGHT_M), along))

    if bolted:
        deep = bolt_y + 0.015 - wide
        size = (0.12, deep, HEIGHT_M)
        parts.append(part(size, (TAB_M + 0.025, wide + deep / 2, middle)))

    return parts


def _steps(job: str, noise_m: float, mouth: float, off: float) -> list[Entry]:
    """Write the motion of a job. A fork that is meant to push a knob to one side comes from that side."""
    aside = SURE * noise_m
    if job == "bolt":
        return _slide("bolt", mouth, -math.pi / 2, aside, UNBOLTED_M)
    if job == "lid":
        return _slide("lid", mouth, 0.0, aside, OPEN_M)
    if job == "out":
        return fetch("gold", GOAL, noise_m, mouth, LIFT_M)
    if job == "shut":
        return _slide("lid", mouth, 0.0, OPEN_M, off / 2 - SLOT_M + KNOB_M)

    return _slide("bolt", mouth, -math.pi / 2, UNBOLTED_M, off / 2 - SLOT_M + KNOB_M)


def _slide(
    name: str, mouth: float, yaw: float, begin: float, end: float
) -> list[Entry]:
    """Write how a fork takes a knob, and pushes it from one place to another along the fork's left."""
    tip = NECK_M + SLOT_LENGTH_M + flare(mouth)
    inside = -(NECK_M + SLOT_LENGTH_M / 2)
    outside = -(tip + KNOB_M + 0.025)
    low = DROP_M + KNOB_ABOVE_M
    high = low + 0.13

    def at(ahead: float, aside: float, height: float, **pace: float) -> Entry:
        x = ahead * math.cos(yaw) - aside * math.sin(yaw)
        y = ahead * math.sin(yaw) + aside * math.cos(yaw)
        return waypoint(name, (x, y, height), round(yaw, 4), **pace)

    return [
        at(outside, begin, high),
        at(outside, begin, low),
        at(inside, begin, low, speed=SLOW_M_S),
        at(inside, end, low, speed=0.12),
        at(outside, end, low, speed=SLOW_M_S),
        at(outside, end, high),
    ]

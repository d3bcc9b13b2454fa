"""Write designs: boxes of a tool, a fork with a funnel, and waypoints of a plan."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import chain

from tasks.ladder.rung import SURE, Entry

POST_M = 0.03  # side of the square post that hangs from the flange
DROP_M = 0.3  # from the flange to the middle of what hangs at the post's end
THICK_M = 0.012
SLOT_M = 0.009  # half the width of a fork's slot
NARROW_M = 0.007  # of one that fits a pawn's stem, and forgives nothing
SLOT_LENGTH_M = 0.05
NECK_M = 0.045  # from the post's axis to the end of the slot
FLARE_RAD = math.radians(35)
LIP_M = 0.01  # by which a funnel is higher than the slot, so that no head slides out
SLOW_M_S = 0.15


def box(
    name: str,
    size: Sequence[float],
    position: Sequence[float],
    yaw: float = 0.0,
    parent: str = "post",
) -> Entry:
    """Write a component: the sides of a box, the place of its middle below the flange, its turn."""
    return {
        "name": name,
        "shape": "box",
        "size": [round(side, 4) for side in size],
        "position": [round(place, 4) for place in position],
        "rpy": [0.0, 0.0, round(yaw, 4)],
        "parent": parent,
    }


def post(length: float = DROP_M) -> Entry:
    """Write the post that carries all else; alone it is a straight rod."""
    size = (POST_M, POST_M, length + THICK_M / 2)
    return box("post", size, (0, 0, -size[2] / 2), parent="tool_mount")


def bar(
    name: str,
    start: tuple[float, float],
    end: tuple[float, float],
    parent: str,
    thick: float = THICK_M,
    drop: float = DROP_M,
) -> Entry:
    """Write a level bar between two points (x, y) at the end of the post."""
    way = (end[0] - start[0], end[1] - start[1])
    middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2, -drop)
    size = (math.hypot(*way), thick, thick)
    return box(name, size, middle, math.atan2(way[1], way[0]), parent)


def fork(mouth: float, slot: float = SLOT_M) -> list[Entry]:
    """Write a fork that opens along x, with a funnel from its ``slot`` to its ``mouth``: half their widths, m."""
    neck_m = NECK_M + POST_M / 2
    width = 2 * (slot + THICK_M)
    size = (neck_m, width, THICK_M)
    neck = box("neck", size, (NECK_M - neck_m / 2, 0, -DROP_M))
    parts = [post(), neck]
    inner = NECK_M + SLOT_LENGTH_M
    for name, side in (("left", 1), ("right", -1)):
        y = side * (slot + THICK_M / 2)
        parts.append(bar(name, (NECK_M, y), (inner, y), "neck"))
        if mouth > slot:
            tip = (inner + flare(mouth), side * (mouth + THICK_M / 2))
            drop = DROP_M - LIP_M
            parts.append(bar(f"{name}_flare", (inner, y), tip, name, drop=drop))

    return parts


def flare(mouth: float) -> float:
    """Return how long a fork's funnel is along x, m."""
    return max(mouth - SLOT_M, 0.0) / math.tan(FLARE_RAD)


def funnel(noise_m: float, radius: float) -> float:
    """Return half the width of a mouth that takes in a stem wherever it is, m."""
    return SURE * noise_m + radius + 0.002


def waypoint(
    anchor: str, place: Sequence[float], yaw: float = 0.0, **pace: float
) -> Entry:
    """Write a waypoint of the flange, from where ``anchor`` is seen, along the world's axes."""
    offset = [round(number, 4) for number in place]
    return {"anchor": anchor, "offset": offset, "rpy": [0.0, 0.0, yaw], **pace}


def join(jobs: Iterable[list[Entry]]) -> list[Entry]:
    """Join the waypoints of jobs to one plan."""
    return list(chain.from_iterable(jobs))


def design(name: str, parts: Sequence[Entry], plan: Sequence[Entry]) -> Entry:
    """Write a design of one tool with one plan."""
    return {
        "strategy_name": name,
        "tool_name": name,
        "gripper": False,
        "tool_components": list(parts),
        "action": "anchored",
        "action_sets": [list(plan)],
    }

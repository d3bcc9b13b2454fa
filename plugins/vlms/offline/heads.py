"""Heads: the working ends of tools, as families of boxes, sized by what they are to move.

A head's frame: x along its motion, y to its left, z up. The origin is at the foot of the face that touches the bodies.
Pieces ahead of the face (x > 0) go around, under or beside the bodies.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple, TypeVar

import numpy as np
from numpy.random import Generator

from core.geometry import Array, Pose
from plugins.vlms.offline.plans import Path
from plugins.vlms.offline.scene_analysis import UP, Subgoal

Use = Literal["push", "surround", "scoop", "hook", "clamp", "guided", "pour"]
Size = tuple[float, float, float]
K = TypeVar("K", bound=Hashable)

FINGER_OPEN = 0.04  # finger extensions are for a hand of the Panda's size, with fingers that open by this
SIDES = (("left", 1.0), ("right", -1.0))
_LEAST_M = 0.003  # clearance between a head and the bodies inside it
_HOOK_WAY = (
    1.4  # how long a hook's arm is at most past covered bodies, in lengths of their way
)
_HOOK_AHEAD_M = 0.1  # and past others
# A hook's arm is at least this thick, as a share of its length. A square bar of steel, half a metre long and this
# thick, bends by 4 mm under 1 N: F L^3 / (3 E I), with I = t^4 / 12. The rules allow 10 mm, with what carries it.
_HOOK_STOUTNESS = 0.01


class Piece(NamedTuple):
    """A box of a head: its pose in the head's frame, its full sides, and the number of its parent piece."""

    name: str
    pose: Pose
    size: Size
    parent: int = 0


@dataclass(frozen=True, eq=False)
class Head:
    """The working end of a tool.

    ``hold`` (3,) is the point where the shaft's axis meets the first piece. ``depth`` is the length ahead of the face,
    ``width`` the length across. ``level`` is the height above the bodies' foot. ``aside`` (3,), for a hook, is the
    offset at which it passes the bodies before it is behind them. ``primitive``, of a guided head, adds the waypoints
    of its own motion to a path. A head with a ``pose``, in the frame of the tool mount, needs no shaft.
    """

    kind: str
    use: Use
    pieces: tuple[Piece, ...]
    hold: Array
    depth: float
    width: float
    level: float = 0.0
    aside: Array = field(default_factory=lambda: np.zeros(3))
    primitive: Callable[[Path, Generator], str] | None = None
    pose: Pose | None = None


def draw(weights: Mapping[K, float], rng: Generator) -> K:
    """Choose at random, by weights."""
    shares = np.array(list(weights.values()))
    return list(weights)[int(rng.choice(len(shares), p=shares / shares.sum()))]


def box(
    name: str,
    x: float,
    y: float,
    z: float,
    size: Size,
    parent: int = 0,
    turn: Pose | None = None,
) -> Piece:
    """A box around a point of the head's frame, or of a frame that is turned in it."""
    pose = Pose(np.array([x, y, z]))
    return Piece(name, pose if turn is None else turn @ pose, size, parent)


def _head(
    kind: str, use: Use, pieces: list[Piece], height: float, depth: float, width: float
) -> Head:
    return Head(
        kind, use, tuple(pieces), np.array([-0.008, 0.0, height - 0.003]), depth, width
    )


def blade(width: float, height: float, thick: float) -> Head:
    wall = box("blade", -thick / 2, 0, height / 2, (thick, width, height))
    return _head("blade" if width > 0.04 else "peg", "push", [wall], height, 0.0, width)


def cage(
    width: float, depth: float, height: float, thick: float, splay: float = 0.0
) -> Head:
    """A blade between two side walls, which open outward by ``splay`` radians; ``width`` is inside."""
    pieces = [*blade(width + 2 * thick, height, thick).pieces]
    length = depth + thick
    for name, side in SIDES:
        turn = Pose.xyz_rpy(
            (0.0, side * (width + thick) / 2, height / 2), (0.0, 0.0, side * splay)
        )
        pieces.append(
            box(
                f"{name}_wall",
                length / 2 - thick,
                0.0,
                0.0,
                (length, thick, height),
                turn=turn,
            )
        )
    return _head(
        "cage" if splay < 0.1 else "funnel",
        "push",
        pieces,
        height,
        depth,
        width + 2 * depth * np.sin(splay),
    )


def wedge(length: float, half_angle: float, height: float, thick: float) -> Head:
    """Two wings that meet in a V that is open in front."""
    pieces = [box("keel", -thick / 2, 0.0, height / 2, (thick, 2 * thick, height))]
    for name, side in SIDES:
        turn = Pose.xyz_rpy((0.0, 0.0, height / 2), (0.0, 0.0, side * half_angle))
        pieces.append(
            box(
                f"{name}_wing",
                length / 2 - thick / 2,
                0.0,
                0.0,
                (length, thick, height),
                turn=turn,
            )
        )
    depth = length * np.cos(half_angle)
    width = 2 * length * np.sin(half_angle)
    return _head("wedge", "push", pieces, height, depth, width)


def rake(width: float, height: float, thick: float, gap: float) -> Head:
    """A bar with tines below it, less than ``gap`` apart."""
    beam = min(0.4 * height, 0.02)
    pieces = [box("beam", -thick / 2, 0.0, height - beam / 2, (thick, width, beam))]
    count = int(np.clip(np.ceil((width - thick) / (gap + thick)) + 1, 2, 12))
    long = height - beam / 2
    for i, y in enumerate(np.linspace((thick - width) / 2, (width - thick) / 2, count)):
        pieces.append(
            box(f"tine_{i + 1}", -thick / 2, float(y), long / 2, (thick, thick, long))
        )
    return _head("rake", "push", pieces, height, 0.0, width)


def pen(width: float, depth: float, height: float, thick: float) -> Head:
    """Four walls without a floor; ``width`` and ``depth`` are inside."""
    around = cage(width, depth + thick, height, thick)
    front = box(
        "front_wall",
        depth + thick / 2,
        0.0,
        height / 2,
        (thick, width + 2 * thick, height),
        parent=1,
    )
    return _head("pen", "surround", [*around.pieces, front], height, depth, width)


def scoop(width: float, depth: float, height: float, rail: float, thick: float) -> Head:
    """A thin floor ahead of a wall, between two rails."""
    wall = max(2.0 * thick, 0.004)
    pieces = [
        box("wall", -wall / 2, 0.0, height / 2, (wall, width, height)),
        box("tray", (depth - wall) / 2, 0.0, thick / 2, (depth + wall, width, thick)),
    ]
    for name, side in SIDES if rail > thick else ():
        y = side * (width - wall) / 2
        pieces.append(
            box(
                f"{name}_rail",
                depth * 0.45,
                y,
                rail / 2,
                (depth * 0.9, wall, rail),
                parent=1,
            )
        )
    return _head("scoop", "scoop", pieces, height, depth, width)


def fork(
    inner: float,
    depth: float,
    height: float,
    tine: float,
    thick: float,
    count: int = 2,
    level: float = 0.0,
) -> Head:
    """Flat tines ahead of a wall; the outer two are ``inner`` apart."""
    width = inner + 2 * tine
    pieces = [box("wall", -0.004, 0.0, height / 2, (0.008, width, height))]
    for i, y in enumerate(np.linspace(-(inner + tine) / 2, (inner + tine) / 2, count)):
        pieces.append(
            box(
                f"tine_{i + 1}",
                (depth - 0.008) / 2,
                float(y),
                thick / 2,
                (depth + 0.008, tine, thick),
            )
        )
    return replace(_head("fork", "scoop", pieces, height, depth, width), level=level)


def hook(
    length: float, toe: float, breadth: float, thick: float, gap: float, outward: Array
) -> Head:
    """An arm that passes beside the bodies, or over them, with a toe at its end that goes behind them.

    Its origin is at the bodies' rear edge; ``outward`` (3,) points from the bodies to the arm, ``gap`` away.
    The toe reaches ``toe`` past the edge and is ``breadth`` wide.
    """
    toe_long = toe + gap + thick
    toe_size = (
        (thick, breadth, toe_long)
        if abs(float(outward[2])) > 0.5
        else (thick, toe_long, breadth)
    )
    arm_at = outward * (gap + thick / 2) + np.array([(length - thick) / 2, 0.0, 0.0])
    toe_at = outward * (gap + thick - toe_long / 2) + np.array([-thick / 2, 0.0, 0.0])
    pieces = (
        Piece("probe", Pose(arm_at), (length + thick, thick, thick)),
        Piece("toe", Pose(toe_at), toe_size),
    )
    hold = arm_at + np.array([length / 2 - thick, 0.0, thick / 2 - 0.002])
    return Head(
        "hook", "hook", pieces, hold, length, toe, aside=outward * (toe + 0.004)
    )


def sample_clamp(subgoal: Subgoal, rng: Generator) -> Head:
    """Two pads, a little farther apart than the bodies are wide, that close by twice the fingers' travel."""
    extent = subgoal.extent(0.0)
    gap = extent.across + rng.uniform(0.01, min(0.06, 2 * FINGER_OPEN - 0.01))
    thick = rng.uniform(0.006, 0.014)
    long = extent.along * rng.uniform(0.3, 1.2)
    if subgoal.deep:  # there is little clearance beside them
        gap = extent.across + rng.uniform(0.006, 0.025)
        thick = thick / 2
        long = extent.along * rng.uniform(0.15, 0.4)
    size = (
        max(0.012, long),
        thick,
        float(np.clip(subgoal.tall * rng.uniform(0.5, 1.3), 0.02, 0.12)),
    )
    pieces = tuple(
        box(f"{name}_pad", 0.0, -side * (gap + thick) / 2, size[2] / 2, size)
        for name, side in SIDES
    )  # the left finger is at the negative y
    return Head(
        "clamp",
        "clamp",
        pieces,
        np.array([0.0, (gap + thick) / 2, size[2]]),
        size[0] / 2,
        gap,
    )


def sample_head(subgoal: Subgoal, rng: Generator, stout: float = 1.0) -> Head:
    """A head of a suitable family at random, sized by the bodies; walls are ``stout`` times as thick as usual."""
    rises = subgoal.shift[2] > 0.03
    falls = subgoal.shift[2] < -0.1
    # A body that falls is pushed horizontally and goes down by itself.
    barred = subgoal.length > 0.03 and subgoal.blocked(
        subgoal.shift * np.array([1.0, 1.0, float(not falls)])
    )
    extent = subgoal.extent(subgoal.heading)
    rooms = subgoal.rooms(subgoal.heading)
    widest = (
        extent.across + 2 * min(rooms) - 0.002
    )  # a head that moves behind the bodies
    if rises or (barred and rng.random() < 0.8) or (falls and rng.random() < 0.3):
        return _lifter(subgoal, extent.along, extent.across, widest, stout, rng)
    if rng.random() < (0.8 if subgoal.covered else 0.08):
        return _hook(subgoal, extent.along, extent.across, rooms, stout, rng)
    return _pusher(subgoal, extent.along, extent.across, widest, stout, rng)


def _pusher(
    subgoal: Subgoal,
    along: float,
    across: float,
    widest: float,
    stout: float,
    rng: Generator,
) -> Head:
    """A head that moves bodies horizontally, by its face or by enclosing them."""
    thick = stout * rng.uniform(0.004, 0.012)
    height = float(np.clip(subgoal.tall * rng.uniform(0.5, 1.3), 0.02, 0.15))
    kinds = {"blade": 2.0, "peg": 0.7}
    spare = rng.uniform(0.004, 0.04)
    if widest > across + 0.02:
        kinds |= {"cage": 3.0, "pen": 1.2, "funnel": 1.0, "wedge": 1.0, "rake": 0.7}
        spare = max(_LEAST_M, min(spare, (widest - across) / 2 - thick))
    match draw(kinds, rng):
        case "blade":
            return blade(min(widest, across * rng.uniform(0.7, 2.0)), height, thick)
        case "peg":
            side = min(widest, rng.uniform(0.012, 0.035))
            return blade(side, height, min(side, 0.02))
        case "cage":
            return cage(
                across + 2 * spare, along * rng.uniform(0.4, 1.1), height, thick
            )
        case "pen":
            return pen(across + 2 * spare, along + 2 * spare, height, thick)
        case "funnel":
            depth = along * rng.uniform(0.4, 1.0)
            splay = rng.uniform(0.1, 0.6)
            return cage(across + 2 * spare, depth, height, thick, splay)
        case "wedge":
            half = rng.uniform(0.6, 1.2)
            return wedge(
                across * rng.uniform(0.6, 1.2) / np.sin(half), half, height, thick
            )
        case _:
            smallest = min(
                float(np.ptp(solid.points[:, :2], axis=0).min())
                for solid in subgoal.solids
            )
            return rake(
                min(widest, across * rng.uniform(1.0, 1.6)),
                height,
                thick,
                0.6 * smallest,
            )


def _lifter(
    subgoal: Subgoal,
    along: float,
    across: float,
    widest: float,
    stout: float,
    rng: Generator,
) -> Head:
    """A head that goes under the bodies, or under their overhang if they have one."""
    height = float(np.clip(subgoal.tall * rng.uniform(0.7, 1.3), 0.02, 0.2))
    depth = along * rng.uniform(0.75, 1.15)
    boxes = subgoal.boxes
    foot = subgoal.lower[2]
    out, halves = subgoal.overhang(subgoal.heading)
    if out.any() and rng.random() < 0.8:
        lower = boxes.bounds[0][:, 2]
        under = float(lower[out].min() - foot)
        base = float(halves[~out & (lower < foot + under)].max())
        tine = max(0.004, (across / 2 - base) * rng.uniform(0.5, 1.2))
        thin = float(np.clip(under * rng.uniform(0.3, 0.7), 0.002, stout * 0.01))
        level = max(0.0, under - thin - rng.uniform(0.003, 0.02))
        return fork(
            2 * base + rng.uniform(0.004, 0.016), depth, height, tine, thin, level=level
        )
    if rng.random() < 0.2:
        tine = across * rng.uniform(0.08, 0.2)
        return fork(
            across * rng.uniform(0.4, 0.7),
            depth,
            height,
            tine,
            stout * 0.002,
            int(rng.integers(2, 5)),
        )
    rail = 0.0 if rng.random() < 0.3 else subgoal.tall * rng.uniform(0.1, 0.6)
    width = min(across + rng.uniform(0.005, 0.04), max(widest, 0.6 * across))
    return scoop(width, depth, height, rail, stout * rng.uniform(0.001, 0.003))


def _hook(
    subgoal: Subgoal,
    along: float,
    across: float,
    rooms: tuple[float, float],
    stout: float,
    rng: Generator,
) -> Head:
    """A head that passes beside or over the bodies, and pulls them from behind."""
    sides = [
        (rooms[0], np.array([0.0, -1.0, 0.0])),
        (rooms[1], np.array([0.0, 1.0, 0.0])),
        (subgoal.headroom, UP),
    ]
    room, outward = sides[
        draw({i: min(room, 0.1) + 1e-3 for i, (room, _) in enumerate(sides)}, rng)
    ]
    over = outward[2] > 0.5
    longest = along + (_HOOK_WAY * subgoal.length if subgoal.covered else _HOOK_AHEAD_M)
    least = max(0.003, _HOOK_STOUTNESS * longest)
    thick = float(np.clip(room * stout * rng.uniform(0.1, 0.25), least, stout * 0.014))
    gap = min(0.004, 0.1 * room)
    extent = subgoal.tall if over else across
    toe = float(
        np.clip(
            (room - thick - gap) * rng.uniform(0.5, 0.9),
            0.004,
            extent * rng.uniform(0.5, 1.0),
        )
    )
    breadth = (across if over else subgoal.tall) * rng.uniform(0.4, 0.9)
    if subgoal.covered:
        length = along + subgoal.length * rng.uniform(0.9, _HOOK_WAY)
    else:
        length = along + rng.uniform(0.02, _HOOK_AHEAD_M)
    return hook(length, toe, breadth, thick, gap, outward)

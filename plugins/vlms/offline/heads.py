"""Heads: the working ends of tools, as families of boxes.

A head's frame: x along its stroke, y to its left, z up. The origin is at the foot of the face that touches the bodies.
Pieces ahead of the face (x > 0) go around, under or beside the bodies.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from core.geometry import Array, Pose
from plugins.vlms.offline.plans import Path

Use = Literal["push", "surround", "scoop", "hook", "clamp", "pour", "pinch", "guided"]


@dataclass(frozen=True, eq=False)
class Piece:
    """A box of a head: its pose in the head's frame, its full sides, and the number of its parent piece."""

    name: str
    pose: Pose
    size: tuple[float, float, float]
    parent: int = 0


@dataclass(frozen=True, eq=False)
class Head:
    """The working end of a tool.

    ``hold`` (3,) is the point where the shaft's axis meets the first piece. ``depth`` is the length ahead of the face,
    ``width`` the length across. ``level`` is the height above the bodies' foot. ``aside`` (3,), for a hook, is the
    offset at which it passes the bodies before it is behind them. ``turn``, for a pinch, is where its x points.
    ``way``, of a guided head, adds its own waypoints to a path.
    """

    kind: str
    use: Use
    pieces: tuple[Piece, ...]
    hold: Array
    depth: float
    width: float
    level: float = 0.0
    aside: Array = field(default_factory=lambda: np.zeros(3))
    turn: float = 0.0
    way: Callable[[Path, np.random.Generator], str] | None = None


def box(name: str, x: float, y: float, z: float, size: tuple[float, float, float], parent: int = 0) -> Piece:
    return Piece(name, Pose(np.array([x, y, z])), size, parent)


def _wall(width: float, height: float, thick: float) -> Piece:
    return box("blade", -thick / 2, 0, height / 2, (thick, width, height))


def _head(kind: str, use: Use, pieces: list[Piece], height: float, depth: float, width: float) -> Head:
    return Head(kind, use, tuple(pieces), np.array([-0.008, 0.0, height - 0.003]), depth, width)


def blade(width: float, height: float, thick: float) -> Head:
    return _head("blade" if width > 0.04 else "peg", "push", [_wall(width, height, thick)], height, 0.0, width)


def cage(width: float, depth: float, height: float, thick: float, splay: float = 0.0) -> Head:
    """A blade between two side walls, which open outward by ``splay`` radians; ``width`` is inside."""
    pieces = [_wall(width + 2 * thick, height, thick)]
    for name, side in (("left_wall", 1.0), ("right_wall", -1.0)):
        turn = Pose.xyz_rpy((0.0, side * (width + thick) / 2, height / 2), (0.0, 0.0, side * splay))
        length = depth + thick
        pose = turn @ Pose(np.array([length / 2 - thick, 0.0, 0.0]))
        pieces.append(Piece(name, pose, (length, thick, height)))
    return _head("cage" if splay < 0.1 else "funnel", "push", pieces, height, depth, width + 2 * depth * np.sin(splay))


def wedge(length: float, half_angle: float, height: float, thick: float) -> Head:
    """Two wings that meet in a V that is open in front."""
    pieces = [box("keel", -thick / 2, 0.0, height / 2, (thick, 2 * thick, height))]
    for name, side in (("left_wing", 1.0), ("right_wing", -1.0)):
        turn = Pose.xyz_rpy((0.0, 0.0, height / 2), (0.0, 0.0, side * half_angle))
        pieces.append(Piece(name, turn @ Pose(np.array([length / 2 - thick / 2, 0.0, 0.0])), (length, thick, height)))
    depth, width = length * np.cos(half_angle), 2 * length * np.sin(half_angle)
    return _head("wedge", "push", pieces, height, depth, width)


def rake(width: float, height: float, thick: float, gap: float) -> Head:
    """A bar with tines below it, less than ``gap`` apart."""
    beam = min(0.4 * height, 0.02)
    pieces = [box("beam", -thick / 2, 0.0, height - beam / 2, (thick, width, beam))]
    count = int(np.clip(np.ceil((width - thick) / (gap + thick)) + 1, 2, 12))
    long = height - beam / 2
    for i, y in enumerate(np.linspace((thick - width) / 2, (width - thick) / 2, count)):
        pieces.append(box(f"tine_{i + 1}", -thick / 2, float(y), long / 2, (thick, thick, long)))
    return _head("rake", "push", pieces, height, 0.0, width)


def pen(width: float, depth: float, height: float, thick: float) -> Head:
    """Four walls without a floor; ``width`` and ``depth`` are inside."""
    around = cage(width, depth + thick, height, thick)
    front = box("front_wall", depth + thick / 2, 0.0, height / 2, (thick, width + 2 * thick, height), parent=1)
    return _head("pen", "surround", [*around.pieces, front], height, depth, width)


def scoop(width: float, depth: float, height: float, rail: float, thick: float) -> Head:
    """A thin floor ahead of a wall, between two rails."""
    wall = max(2.0 * thick, 0.004)
    pieces = [
        box("wall", -wall / 2, 0.0, height / 2, (wall, width, height)),
        box("tray", (depth - wall) / 2, 0.0, thick / 2, (depth + wall, width, thick)),
    ]
    if rail > thick:
        for name, side in (("left_rail", 1.0), ("right_rail", -1.0)):
            y = side * (width - wall) / 2
            pieces.append(box(name, depth * 0.45, y, rail / 2, (depth * 0.9, wall, rail), parent=1))
    return _head("scoop", "scoop", pieces, height, depth, width)


def fork(
    inner: float, depth: float, height: float, tine: float, thick: float, count: int = 2, level: float = 0.0
) -> Head:
    """Flat tines ahead of a wall; the outer two are ``inner`` apart."""
    width = inner + 2 * tine
    pieces = [box("wall", -0.004, 0.0, height / 2, (0.008, width, height))]
    for i, y in enumerate(np.linspace(-(inner + tine) / 2, (inner + tine) / 2, count)):
        pieces.append(box(f"tine_{i + 1}", (depth - 0.008) / 2, float(y), thick / 2, (depth + 0.008, tine, thick)))
    return replace(_head("fork", "scoop", pieces, height, depth, width), level=level)


def hook(length: float, toe: float, breadth: float, thick: float, gap: float, outward: Array) -> Head:
    """An arm that passes beside the bodies, or over them, with a toe at its end that goes behind them.

    Its origin is at the bodies' rear edge; ``outward`` (3,) points from the bodies to the arm, ``gap`` away.
    The toe reaches ``toe`` past the edge and is ``breadth`` wide.
    """
    upright = abs(float(outward[2])) > 0.5
    arm_size = (length + thick, thick, thick)
    toe_long = toe + gap + thick
    toe_size = (thick, breadth, toe_long) if upright else (thick, toe_long, breadth)
    arm_at = outward * (gap + thick / 2) + np.array([(length - thick) / 2, 0.0, 0.0])
    toe_at = outward * (gap + thick - toe_long / 2) + np.array([-thick / 2, 0.0, 0.0])
    pieces = (Piece("probe", Pose(arm_at), arm_size), Piece("toe", Pose(toe_at), toe_size))
    hold = arm_at + np.array([length / 2 - thick, 0.0, thick / 2 - 0.002])
    return Head("hook", "hook", pieces, hold, length, toe, aside=outward * (toe + 0.004))

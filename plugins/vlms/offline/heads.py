"""The working end of a tool: boxes in a frame of its own, and how it moves.

In a head's frame x points where it works, y to its left and z up. Lengths are metres, angles radians.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from core.geometry import Array, Box, Pose
from plugins.vlms.offline.layout import Size

_LEAST_SIDE_M = 0.0005  # a side, at least


@dataclass(frozen=True, eq=False)
class Piece:
    """A box of a head.

    Attributes:
        name: of the component that it becomes.
        pose: of its middle, in the head's frame.
        size: its full sides.
        parent: the number of the piece that bears it; the first one is borne by the shaft.
    """

    name: str
    pose: Pose
    size: Size
    parent: int = 0

    @cached_property
    def shape(self) -> Box:
        """The box, at least half a millimetre thick: values that are mutated can leave a side less than nothing."""
        x, y, z = (max(side, _LEAST_SIDE_M) for side in self.size)
        return Box((x, y, z))


def box(
    name: str,
    x: float,
    y: float,
    z: float,
    size: Size,
    parent: int = 0,
) -> Piece:
    """Make an upright box around a point of the head's frame; see `Piece`."""
    return Piece(name, Pose(np.array([x, y, z])), size, parent)


def lay(long: float, thick: float, wide: float, side: Array) -> Size:
    """Return the sides of a plate that is long along x, thick along a side (3,), which is y or z, and else wide."""
    _, y, z = np.where(side != 0, thick, wide)
    return long, float(y), float(z)


def build_walls(
    thick: float, inside: float, depth: float, height: float
) -> list[Piece]:
    """Build a wall across x and one on each side, which go on before it.

    Args:
        thick: each wall.
        inside: the width between the two.
        depth: how far they go on from the front of the first.
        height: of all.
    """
    along = (depth + thick, thick, height)
    x = (depth - thick) / 2
    y = (inside + thick) / 2
    return [
        box("back", -thick / 2, 0.0, height / 2, (thick, inside + 2 * thick, height)),
        box("left", x, y, height / 2, along),
        box("right", x, -y, height / 2, along),
    ]


@dataclass(frozen=True, eq=False)
class Head:
    """The working end of a tool.

    Attributes:
        pieces: its boxes; the first one is borne by the shaft.
        attach: where the shaft ends, (3,).
        text: what it is, in words.
        mount: its pose in the frame of the tool mount, where it needs no shaft; None: it is placed by what the arm
            reaches.
    """

    pieces: Sequence[Piece]
    attach: Array
    text: str
    mount: Pose | None = None

    @cached_property
    def corners(self) -> Array:
        """The corners of its boxes, (Q, 3)."""
        return np.concatenate(
            [piece.pose.apply(piece.shape.corners) for piece in self.pieces]
        )

    @property
    def tip(self) -> Array:
        """Its corner that is farthest from where it is attached, (3,)."""
        away = np.linalg.norm(self.corners - self.attach, axis=1)
        return np.asarray(self.corners[away.argmax()])

    @property
    def bottom(self) -> float:
        """The height of its lowest point."""
        return float(self.corners[:, 2].min())


@dataclass(frozen=True, eq=False)
class Step:
    """A pose of a head, in the frame of a job.

    Attributes:
        pose: where it gets.
        speed: on the way there, m/s; None: as fast as the arm goes.
        touch: whether it may touch the bodies on the way there.
        grip: how far the fingers are closed then, 0 to 1.
    """

    pose: Pose
    speed: float | None = None
    touch: bool = False
    grip: float = 0.0


def at(
    x: float,
    y: float,
    z: float,
    *,
    roll: float = 0.0,
    pitch: float = 0.0,
    yaw: float = 0.0,
) -> Pose:
    """Return a pose of a head."""
    return Pose.xyz_rpy((x, y, z), (roll, pitch, yaw))

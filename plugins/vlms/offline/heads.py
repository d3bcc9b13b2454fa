"""Heads: the working ends of tools, as families of boxes.

A head's frame: x along its motion, y to its left, z up. The origin is at the foot of the face that touches the bodies.
Pieces ahead of the face (x > 0) go around, under or beside the bodies. All lengths are in metres.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.random import Generator

from core.geometry import Array, Pose
from plugins.vlms.offline.paths import HeadPath

Primitive = Literal[
    "push", "surround", "scoop", "hook", "clamp", "cup", "guided", "pour"
]
Motion = Callable[[HeadPath, Generator], str]
"""Adds the waypoints of a motion to a path, and says what it does."""
Size = tuple[float, float, float]

FINGER_OPEN = 0.04  # finger extensions are for a hand of the Panda's size, with fingers that open by this
SIDES = (("left", 1.0), ("right", -1.0))
# Thickness of a fork's wall; the shaft's axis is as far behind the face.
_BACK_M = 0.008
_PEG_M = 0.04  # a blade that is no wider is called a peg
_SPLAYED_RAD = 0.1  # a cage whose walls open by more is called a funnel
_RAKE_BAR = 0.4  # of a rake's height that its bar has, at most,
_MOST_BAR_M = 0.02  # and this: bodies meet its tines
_MOST_TINES = 12
_SCOOP_WALL_M = 0.004  # thick, at least
_RAIL = 0.9  # of a scoop's depth: its edge is free
_TOE_CLEAR_M = 0.004  # between a hook's toe and the bodies that it passes
_SHAFT_INTO_M = 0.002  # how far the shaft goes into a hook's arm
_INTO_M = 0.003  # how far the shaft goes into the head
_KNOB_M = 0.018  # each side: a shaft that ends in it does not come out below


@dataclass(frozen=True, eq=False)
class Piece:
    """A box of a head.

    Attributes:
        name: of the component that it becomes.
        pose: in the head's frame.
        size: full sides.
        parent: the number of its parent piece.
    """

    name: str
    pose: Pose
    size: Size
    parent: int = 0


@dataclass(frozen=True, eq=False)
class Head:
    """The working end of a tool.

    Attributes:
        kind: its family, in a word.
        primitive: how it moves bodies; ``guided`` and ``pour`` have a ``motion`` of their own.
        pieces: its boxes.
        attachment: where the shaft's axis meets the first piece, (3,).
        depth: the length ahead of the face.
        width: the length across.
        level: the height above the bodies' foot.
        aside: of a hook, the offset (3,) at which it passes the bodies before it is behind them.
        motion: of a head that has its own.
        mount_pose: of a head that needs no shaft, its pose in the frame of the tool mount.
        behind: how far behind its origin the tool mount is to be, as something is above the head where it works; None:
            anywhere.
    """

    kind: str
    primitive: Primitive
    pieces: tuple[Piece, ...]
    attachment: Array
    depth: float
    width: float
    level: float = 0.0
    aside: Array = field(default_factory=lambda: np.zeros(3))
    motion: Motion | None = None
    mount_pose: Pose | None = None
    behind: float | None = None


def make_piece(
    name: str,
    x: float,
    y: float,
    z: float,
    size: Size,
    parent: int = 0,
) -> Piece:
    """Make a box around a point of the head's frame.

    Args:
        name: of the component that it becomes.
        x: of its middle, along the head's motion.
        y: of its middle, to the left.
        z: of its middle, up.
        size: full sides.
        parent: the number of its parent piece.
    """
    return Piece(name, Pose(np.array([x, y, z])), size, parent)


def _make_head(
    kind: str,
    primitive: Primitive,
    pieces: list[Piece],
    height: float,
    depth: float,
    width: float,
) -> Head:
    """Make a head whose shaft ends at the top of its first piece.

    Args:
        kind: see `Head`.
        primitive: see `Head`.
        pieces: the first one bears the others, or their parents.
        height: of the first piece.
        depth: see `Head`.
        width: see `Head`.
    """
    attachment = np.array([-_BACK_M, 0.0, height - _INTO_M])
    return Head(kind, primitive, tuple(pieces), attachment, depth, width)


def make_blade(width: float, height: float, thick: float) -> Head:
    """Make an upright wall; a narrow one is a peg.

    Args:
        width: across the motion.
        height: of the wall.
        thick: along the motion.
    """
    wall = make_piece("blade", -thick / 2, 0, height / 2, (thick, width, height))
    kind = "blade" if width > _PEG_M else "peg"
    return _make_head(kind, "push", [wall], height, 0.0, width)


def _make_wings(
    name: str,
    y: float,
    angle: float,
    x: float,
    size: Size,
) -> list[Piece]:
    """Make two upright walls, mirrored, each turned outward about an upright axis.

    Args:
        name: of a wall, after its side.
        y: of the left one's axis.
        angle: by which each is turned, radians.
        x: from the axis to the middle of the wall.
        size: of each.
    """
    wings = []
    for side_name, side in SIDES:
        axis = Pose.xyz_rpy((0.0, side * y, size[2] / 2), (0.0, 0.0, side * angle))
        pose = axis @ Pose(np.array([x, 0.0, 0.0]))
        wings.append(Piece(f"{side_name}_{name}", pose, size))

    return wings


def _make_tines(
    count: int,
    y: float,
    x: float,
    z: float,
    size: Size,
) -> list[Piece]:
    """Make tines side by side.

    Args:
        count: of tines.
        y: of the middle of the outermost, to both sides.
        x: of the middle of each.
        z: of the middle of each.
        size: of each.
    """
    return [
        make_piece(f"tine_{number}", x, place, z, size)
        for number, place in enumerate(np.linspace(-y, y, count).tolist(), start=1)
    ]


def make_cage(
    width: float,
    depth: float,
    height: float,
    thick: float,
    splay: float = 0.0,
) -> Head:
    """Make a blade between two side walls.

    Args:
        width: between the walls.
        depth: how far they go ahead of the blade.
        height: of all three.
        thick: of all three.
        splay: by how much the walls open outward, radians.
    """
    back = make_blade(width + 2 * thick, height, thick).pieces
    size = (depth + thick, thick, height)
    middle = (depth + thick) / 2 - thick
    walls = _make_wings("wall", (width + thick) / 2, splay, middle, size)

    kind = "cage" if splay < _SPLAYED_RAD else "funnel"
    widest = width + 2 * depth * np.sin(splay)
    return _make_head(kind, "push", [*back, *walls], height, depth, widest)


def make_wedge(
    length: float,
    half_angle: float,
    height: float,
    thick: float,
) -> Head:
    """Make two wings that meet in a V that is open in front.

    Args:
        length: of each wing.
        half_angle: between a wing and the motion, radians.
        height: of the wings.
        thick: of the wings.
    """
    keel_size = (thick, 2 * thick, height)
    keel = make_piece("keel", -thick / 2, 0.0, height / 2, keel_size)
    size = (length, thick, height)
    wings = _make_wings("wing", 0.0, half_angle, length / 2 - thick / 2, size)

    depth = length * np.cos(half_angle)
    width = 2 * length * np.sin(half_angle)
    return _make_head("wedge", "push", [keel, *wings], height, depth, width)


def make_rake(
    width: float,
    height: float,
    thick: float,
    gap: float,
) -> Head:
    """Make a bar with tines below it.

    Args:
        width: of the bar.
        height: from the tines' ends to the bar's upper face.
        thick: of bar and tines.
        gap: between two tines, at most.
    """
    bar = min(_RAKE_BAR * height, _MOST_BAR_M)
    bar_size = (thick, width, bar)
    beam = make_piece("beam", -thick / 2, 0.0, height - bar / 2, bar_size)

    gaps = np.ceil((width - thick) / (gap + thick))
    count = int(np.clip(gaps + 1, 2, _MOST_TINES))
    length = height - bar / 2
    size = (thick, thick, length)
    tines = _make_tines(count, (width - thick) / 2, -thick / 2, length / 2, size)
    return _make_head("rake", "push", [beam, *tines], height, 0.0, width)


def make_pen(
    width: float,
    depth: float,
    height: float,
    thick: float,
) -> Head:
    """Make four walls without a floor; ``width`` and ``depth`` are inside.

    Args:
        width: inside, across the motion.
        depth: inside, along the motion.
        height: of the walls.
        thick: of the walls.
    """
    around = make_cage(width, depth + thick, height, thick)
    size = (thick, width + 2 * thick, height)
    x = depth + thick / 2
    front = make_piece("front_wall", x, 0.0, height / 2, size, parent=1)
    pieces = [*around.pieces, front]

    return _make_head("pen", "surround", pieces, height, depth, width)


def make_cup(
    width: float,
    depth: float,
    height: float,
    thick: float,
) -> Head:
    """Make four walls below a lid with a knob for the shaft; the first three measures are inside.

    Args:
        width: inside, across the motion.
        depth: inside, along the motion.
        height: of the walls.
        thick: of walls and lid.
    """
    top = height + thick
    knob_size = (_KNOB_M, _KNOB_M, _KNOB_M)
    knob = make_piece("knob", depth / 2, 0.0, top + _KNOB_M / 2, knob_size)
    lid_size = (depth + 2 * thick, width + 2 * thick, thick)
    lid = make_piece("lid", depth / 2, 0.0, height + thick / 2, lid_size)
    pen = make_pen(width, depth, height, thick)
    walls = [replace(wall, parent=1) for wall in pen.pieces]
    attachment = np.array([depth / 2, 0.0, top + _KNOB_M - _INTO_M])

    return Head("cup", "cup", (knob, lid, *walls), attachment, depth, width)


def make_scoop(
    width: float,
    depth: float,
    height: float,
    rail: float,
    thick: float,
) -> Head:
    """Make a thin floor ahead of a wall, between two rails of the height ``rail``.

    Args:
        width: across the motion.
        depth: of the floor, ahead of the wall.
        height: of the wall.
        rail: height of the rails; not more than ``thick``: there are none.
        thick: of the floor.
    """
    wall = max(2.0 * thick, _SCOOP_WALL_M)
    tray_size = (depth + wall, width, thick)
    pieces = [
        make_piece("wall", -wall / 2, 0.0, height / 2, (wall, width, height)),
        make_piece("tray", (depth - wall) / 2, 0.0, thick / 2, tray_size),
    ]
    if rail > thick:
        x = depth * _RAIL / 2
        size = (depth * _RAIL, wall, rail)
        for name, side in SIDES:
            y = side * (width - wall) / 2
            pieces.append(make_piece(f"{name}_rail", x, y, rail / 2, size, parent=1))

    return _make_head("scoop", "scoop", pieces, height, depth, width)


def make_fork(
    inner: float,
    depth: float,
    height: float,
    tine: float,
    thick: float,
    count: int = 2,
    level: float = 0.0,
    back: float = _BACK_M,
) -> Head:
    """Make flat tines ahead of a wall.

    Args:
        inner: between the outer two tines.
        depth: how far they go ahead of the wall.
        height: of the wall.
        tine: width of each.
        thick: of each.
        count: of tines.
        level: see `Head`.
        back: thickness of the wall.
    """
    width = inner + 2 * tine
    wall_size = (back, width, height)
    wall = make_piece("wall", -back / 2, 0.0, height / 2, wall_size)
    size = (depth + back, tine, thick)
    x = (depth - back) / 2
    tines = _make_tines(count, (inner + tine) / 2, x, thick / 2, size)
    pieces = [wall, *tines]
    head = _make_head("fork", "scoop", pieces, height, depth, width)

    return replace(head, level=level)


def add_stem(head: Head, height: float, thick: float) -> Head:
    """Put a stem on a head, so that the shaft is attached as high as to a higher wall, for less weight.

    Args:
        head: whose first piece is a wall or a beam.
        height: of the stem above the head's foot.
        thick: both sides of the stem.
    """
    stem = make_piece("stem", -thick / 2, 0.0, height / 2, (thick, thick, height))
    first, *others = head.pieces
    moved = (replace(piece, parent=piece.parent + 1) for piece in others)
    attachment = np.array([-_BACK_M, 0.0, height - _INTO_M])

    return replace(head, pieces=(stem, first, *moved), attachment=attachment)


def make_hook(
    length: float,
    toe: float,
    breadth: float,
    thick: float,
    gap: float,
    outward: Array,
) -> Head:
    """Make an arm that passes beside the bodies, or over them, with a toe that goes behind them.

    The origin is at the bodies' rear edge.

    Args:
        length: of the arm, past the edge.
        toe: how far the toe reaches past the edge.
        breadth: of the toe.
        thick: of arm and toe.
        gap: between the arm and the bodies.
        outward: the unit vector (3,) from the bodies to the arm.
    """
    toe_length = toe + gap + thick
    toe_size = (thick, toe_length, breadth)
    if abs(outward[2]) > 0.5:
        toe_size = (thick, breadth, toe_length)

    along_arm = np.array([(length - thick) / 2, 0.0, 0.0])
    arm_center = outward * (gap + thick / 2) + along_arm
    behind = np.array([-thick / 2, 0.0, 0.0])
    toe_center = outward * (gap + thick - toe_length / 2) + behind
    pieces = (
        Piece("probe", Pose(arm_center), (length + thick, thick, thick)),
        Piece("toe", Pose(toe_center), toe_size),
    )
    front = np.array([length / 2 - thick, 0.0, thick / 2 - _SHAFT_INTO_M])

    return Head(
        "hook",
        "hook",
        pieces,
        arm_center + front,
        length,
        toe,
        aside=outward * (toe + _TOE_CLEAR_M),
    )


def add_second_toe(head: Head, ahead: float) -> Head:
    """Give a hook a toe before the bodies, too, so that it pushes them back.

    Args:
        head: a hook, whose second piece is its toe.
        ahead: of the first toe, metres.
    """
    _, toe = head.pieces
    pose = Pose(toe.pose.position + np.array([ahead, 0.0, 0.0]))
    return replace(head, pieces=(*head.pieces, Piece("second_toe", pose, toe.size)))

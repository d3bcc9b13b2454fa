"""Slide a tool's attachment onto a finger, by a sleeve with a clamping screw.

Lengths of settings are millimetres, all else metres, in the frame of the mount.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from core.geometry import Array, Mesh, Pose
from core.robot.extents import Finger, fingers_of
from core.robot.solids import corners, robot_solids
from core.support.templates import macros
from core.values.robots import Robot
from plugins.results.workshop.mount import Mount
from plugins.results.workshop.printing import Check
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.solid import Placed, ToolLink, box, rod, union

WALL_MM = 2.4
SLEEVE_MM = 25.0  # its length from the finger's tip
BASE_M = 0.15  # from the tip to a finger's base, more than any finger has
MOST_LOST = 0.5  # of an attachment, where the finger is
CORE_MM = 2.5  # bore of a thread M3, which metal takes without an insert
CLAMP_MM = 6.0  # thickness of plastic around a clamping insert


def on_finger(robot: Robot, link: ToolLink, solid: Any, fit: Fit) -> Mount:
    """Make the sleeve that an attachment is slid onto a finger with, and its clamping screw.

    The finger's collision shapes, moved along it to its base, are cut out of the attachment: it goes on from the tip.

    Args:
        robot: the arm, with its gripper.
        link: the link of the tool that the finger bears.
        solid: the link as a Manifold, millimetres.
        fit: the gap between sleeve and finger, and the bore of the clamping screw.

    Returns:
        The solid with its sleeve, the screw to buy, and what was checked.
    """
    finger = next(finger for finger in fingers_of(robot) if finger.name == link.bearer)
    gap = fit.sleeve_mm / 1000
    wall = WALL_MM / 1000
    slid = _slide_to_base(robot, finger)
    cavity = tuple((shape.resized(shape.bounds[1] + 2 * gap), Pose()) for shape in slid)
    low, high = _find_clasped(slid, finger)
    low = low - gap
    high = high + gap
    around = np.ones(3) - np.abs(finger.tip)
    outer_low = low - wall * (around + np.maximum(-finger.tip, 0))
    outer_high = high + wall * (around + np.maximum(finger.tip, 0))
    walls = box(outer_low, outer_high)
    clamp, bore = _clamp(finger, low, high, fit.insert_mm)

    lost = (solid ^ union(cavity)).volume() / solid.volume()
    words = macros("plugins.results.workshop", "words")
    stands = f"its wall stands {1000 * (gap + wall):.1f} mm before the inner face"

    mend = "move the attachment beyond the fingertip, or make it wider than the finger"
    adding = (walls, clamp)
    taking = (*cavity, bore)

    return Mount(
        solid=solid + union(adding) - union(taking),
        name=f"{link.bearer}_sleeve",
        simulated=(*_sheets(finger, low, high, wall), clamp),
        adding=adding,
        taking=taking,
        checks=(
            Check("finger", lost < MOST_LOST, words.cut_away(lost), mend),
            Check("sleeve", True, stands),
        ),
        hardware=(
            "1 x M3 x 8 set screw",
            words.sleeve_screw(fit.insert_mm, CORE_MM),
        ),
    )


def _slide_to_base(robot: Robot, finger: Finger) -> list[Mesh]:
    """Return what each collision shape of a finger covers as it moves along it to its base."""
    slid = []
    for part in robot_solids(robot, True):
        if part.name == finger.name:
            points = part.pose.apply(corners(part.geometry))
            slid.append(Mesh.hull_of(np.vstack([points, points - BASE_M * finger.tip])))

    return slid


def _find_clasped(slid: Sequence[Mesh], finger: Finger) -> tuple[Array, Array]:
    """Find the bounds of a finger over the length of the sleeve.

    Args:
        slid: what the finger's shapes cover on their way to its base.
        finger: whose tip the sleeve begins at.

    Returns:
        The lowest and the highest corner, (3,) each, metres.
    """
    tip = finger.tip
    end = finger.face(tip)
    start = end - SLEEVE_MM / 1000 * tip[int(np.abs(tip).argmax())]
    along = np.abs(tip) > 0
    first = np.where(along, min(start, end), -1.0)
    last = np.where(along, max(start, end), 1.0)
    inside = union([(shape, Pose()) for shape in slid]) ^ union([box(first, last)])
    bounds = np.array(inside.bounding_box()) / 1000

    return bounds[:3], bounds[3:]


def _clamp(
    finger: Finger, low: Array, high: Array, insert_mm: float
) -> tuple[Placed, Placed]:
    """Make the block that takes the clamping screw, and its bore.

    Args:
        finger: which it stands beside, square to the way in which it opens.
        low: the lowest corner (3,) of the finger's bounds, metres.
        high: the highest corner (3,), metres.
        insert_mm: the bore's diameter.

    Returns:
        The block, and the bore.
    """
    side = np.cross(np.abs(finger.opens), np.abs(finger.tip))
    widths = high - low
    middle = (low + high) / 2
    out = np.abs(side) * (widths / 2 + CLAMP_MM / 1000)
    half = np.minimum(widths / 2, 0.005) * (1 - np.abs(side))
    block = box(middle - half, middle + half + out)
    end = middle + out + 0.001 * np.abs(side)

    return block, rod(middle, end, insert_mm / 2000)


def _sheets(finger: Finger, low: Array, high: Array, wall: float) -> list[Placed]:
    """Return the walls around a finger's bounds as boxes; at its base they are open.

    Args:
        finger: whose tip is closed.
        low: the lowest corner (3,) of its bounds, metres.
        high: the highest corner (3,), metres.
        wall: the thickness of the walls, metres.
    """
    sheets = []
    for axis in range(3):
        for end, edge in ((-1, low), (1, high)):
            if end * finger.tip[axis] < 0:
                continue

            first = low.copy()
            last = high.copy()
            ends = sorted([edge[axis], edge[axis] + end * wall])
            first[axis], last[axis] = ends
            sheets.append(box(first, last))

    return sheets

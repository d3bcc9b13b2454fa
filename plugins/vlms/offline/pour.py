"""Empty a loose container with handles: take it by the handles, carry it, turn it over.

The fork is used with the flange pointing ahead, so that the arm's last joint turns it over. The head's frame is that of
the flange: x ahead, along the axis of that joint, y left, z up. The prongs are ``level`` below the axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.design import RIGID_MOUNT, Tool
from core.geometry import Array, Pose
from plugins.vlms.offline.heads import Head, Piece
from plugins.vlms.offline.plans import Path
from plugins.vlms.offline.scene_analysis import UP, Errand, Thing
from plugins.vlms.offline.tools import Assembly
from plugins.vlms.offline.workspace import Workspace

AT = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0))
"""The head in the frame of the tool mount."""

_BACK_M = 0.018  # plate and crossbar, from the flange ahead
_LIP_M = 0.004
_LEAST_M = 0.006  # by which a handle stands out


@dataclass(frozen=True, eq=False)
class Handles:
    """Parts that stand out of a thing on both sides of a heading.

    ``base`` and ``outer`` are half widths of the thing without and with its handles; ``low`` and ``high`` the handles'
    lowest and highest z. Along the heading, ``reach`` is the handles' front and ``rear`` the thing's rear. In metres.
    """

    heading: float
    base: float
    outer: float
    low: float
    high: float
    rear: float
    reach: float
    middle: Array

    @property
    def ahead(self) -> Array:
        return np.array([np.cos(self.heading), np.sin(self.heading), 0.0])


def handles(thing: Thing, space: Workspace) -> Handles | None:
    """The handles that are easiest to reach from the arm's side; None if there are none."""
    away = space.direction(thing.position)
    turns = sorted(np.arange(4) * np.pi / 2, key=lambda turn: -np.cos(turn - away))
    found = (_handles(thing, float(heading)) for heading in turns[:2])
    return next((one for one in found if one is not None), None)


def _handles(thing: Thing, heading: float) -> Handles | None:
    boxes = thing.boxes
    middle = (thing.points.min(axis=0) + thing.points.max(axis=0)) / 2
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    side = np.array([-ahead[1], ahead[0], 0.0])

    def extent(way: Array) -> tuple[Array, Array]:
        halves = np.abs(np.einsum("nji,j->ni", boxes.axes, way) * boxes.halves).sum(axis=1)
        at = (boxes.centers - middle) @ way
        return at - halves, at + halves

    right, left = extent(side)
    widest = np.maximum(-right, left)
    low = boxes.lower[:, 2] < thing.points[:, 2].min() + 0.004
    out = ~low & (widest > widest[low].max() + _LEAST_M)
    if not (out & (left > 0)).any() or not (out & (right < 0)).any() or out.all():
        return None
    return Handles(
        heading,
        float(widest[~out].max()),
        float(widest[out].max()),
        float(boxes.lower[out, 2].min()),
        float(boxes.upper[out, 2].max()),
        float(((thing.points - middle) @ ahead).min()),
        float(extent(ahead)[1][out].max()),
        middle,
    )


def sample_fork(grips: Handles, rng: np.random.Generator, stout: float = 1.0) -> Head:
    """Two channels, open toward each other, that slide over the handles; ``stout`` times as thick as usual."""
    lip = stout * _LIP_M
    drop = rng.uniform(0.07, 0.12)
    room = rng.uniform(0.002, 0.005)
    gap = rng.uniform(0.003, 0.012)  # between the crossbar and the thing
    thick = grips.high - grips.low
    inner, outer = grips.base + 0.3 * (grips.outer - grips.base), grips.outer + room
    length = grips.reach - grips.rear + gap + rng.uniform(-0.03, 0.015)
    width = 2 * (outer + lip)
    pieces = [
        Piece("plate", Pose(np.array([0.005, 0.0, -drop / 2])), (0.01, 0.06, drop + 0.07)),
        Piece("crossbar", Pose(np.array([_BACK_M - 0.005, 0.0, -drop])), (0.01, width, 0.03)),
    ]
    along = _BACK_M - 0.002 + length / 2
    for name, sign in (("left", 1.0), ("right", -1.0)):
        y = sign * (outer + lip / 2)
        height = thick + 2 * room + 2 * lip
        pieces.append(Piece(f"{name}_web", Pose(np.array([along, y, -drop])), (length + 0.002, lip, height), 1))
        for edge, up in (("lower", -1.0), ("upper", 1.0)):
            at = np.array([along, sign * (inner + outer) / 2, -drop + up * (thick / 2 + room + lip / 2)])
            pieces.append(Piece(f"{name}_{edge}", Pose(at), (length + 0.002, outer - inner + 0.002, lip), 1))
    hold = np.array([0.0, 0.0, gap])
    return Head("fork", "pour", tuple(pieces), hold, length, width, level=drop)


def build_fork(head: Head) -> Tool:
    assembly = Assembly(False, 0.01)
    assembly.head(head, RIGID_MOUNT, AT)
    text = f"two channels {head.width:.3f} m apart, {head.depth:.3f} m long, that slide over handles"
    return assembly.tool("handle_fork", text)


def pour(path: Path, errand: Errand, head: Head, rng: np.random.Generator) -> str:
    """Slide over the handles of the bodies' container, lift it, carry it to the goal, and turn it over there."""
    grips = handles(errand.holder, errand.space) if errand.holder is not None else None
    if errand.holder is None or grips is None:
        raise ValueError("a fork for handles needs a container with handles")
    gap = float(head.hold[2])
    level = (grips.low + grips.high) / 2 + head.level
    grasp = grips.middle + (grips.rear - gap - _BACK_M) * grips.ahead
    grasp[2] = level
    before = grasp - (head.depth + rng.uniform(0.01, 0.03)) * grips.ahead
    path.go(before + rng.uniform(0.06, 0.15) * UP, grips.heading)
    path.go(before, grips.heading)
    path.stroke(grasp, grips.heading, rng.uniform(0.1, 0.3))
    # High enough for the container to pass over everything near, upright and on its side.
    foot = float(errand.holder.points[:, 2].min())
    high = errand.clear_z + max(level - foot, float(np.ptp(errand.holder.points[:, :2], axis=0).min()) / 2)
    high += rng.uniform(0.01, 0.06)
    path.stroke(np.array([*grasp[:2], high]), grips.heading, rng.uniform(0.1, 0.3))
    path.hold()
    place = np.mean([thing.position for thing in errand.things], axis=0) + errand.shift
    heading = errand.space.direction(place) + rng.uniform(-0.5, 0.8)
    sign, turn = float(rng.choice([-1.0, 1.0])), rng.uniform(2.2, 3.0)
    ahead, side = np.array([np.cos(heading), np.sin(heading), 0.0]), np.array([-np.sin(heading), np.cos(heading), 0.0])
    there = place - (gap + _BACK_M - grips.rear) * ahead - sign * 0.5 * head.level * side
    there[2] = high
    path.stroke(there, heading, rng.uniform(0.15, 0.4))
    for share in np.linspace(0.0, 1.0, int(rng.integers(3, 7)) + 1)[1:]:
        path.go(there, heading, roll=sign * share * turn, touch=True)
    for rise in (0.02, 0.0, 0.02):
        path.go(there + rise * UP, heading, roll=sign * turn, touch=True)
    carried = f"slides over the handles, lifts, carries by {errand.length:.2f} m"
    return f"{carried} and turns over by {np.degrees(turn):.0f} degrees"

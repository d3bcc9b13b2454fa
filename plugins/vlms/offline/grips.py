"""Grips: heads that hold a body between two of their pieces, the tools that bear them, and how they are used.

Clamps are pads on both fingers. A pinch is two plates that are pressed over a body and hold it by friction, without a
gripper. A fork takes a loose container by its handles, to carry it and turn it over: it is used with the flange
pointing ahead, so that the arm's last joint turns it over. Its frame is that of the flange: x ahead, along the axis of
that joint, y left, z up; the prongs are ``level`` below the axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.design import RIGID_MOUNT, Tool
from core.geometry import Array, Pose
from plugins.vlms.offline.boxes import axes_of
from plugins.vlms.offline.heads import SIDES, Head, box
from plugins.vlms.offline.plans import Path
from plugins.vlms.offline.scene_analysis import UP, Errand, Thing
from plugins.vlms.offline.tools import FINGER_OPEN, Assembly
from plugins.vlms.offline.workspace import Workspace

FORK_POSE = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0))
"""A fork in the frame of the tool mount."""

_BACK_M = 0.018  # a fork's plate and crossbar, from the flange ahead
_LIP_M = 0.004
_LEAST_M = 0.006  # by which a handle stands out
_BRIDGE_M = 0.008  # thickness of what joins a pinch's plates


def sample_clamp(errand: Errand, rng: np.random.Generator) -> Head:
    """Two pads, a little farther apart than the bodies are wide, that close by twice the fingers' travel."""
    extent = errand.extent(0.0)
    gap = extent.across + rng.uniform(0.01, min(0.06, 2 * FINGER_OPEN - 0.01))
    thick = rng.uniform(0.006, 0.014)
    long = extent.along * rng.uniform(0.3, 1.2)
    if errand.deep:  # there is little clearance beside them
        gap, thick, long = extent.across + rng.uniform(0.006, 0.025), thick / 2, extent.along * rng.uniform(0.15, 0.4)
    size = (max(0.012, long), thick, float(np.clip(errand.tall * rng.uniform(0.5, 1.3), 0.02, 0.12)))
    pieces = tuple(
        box(f"{name}_pad", 0.0, side * (gap + thick) / 2, size[2] / 2, size)
        for name, side in (("left", -1.0), ("right", 1.0))
    )
    return Head("clamp", "clamp", pieces, np.array([0.0, (gap + thick) / 2, size[2]]), size[0] / 2, gap)


def build_clamp(head: Head, pose: Pose, thickness: float) -> Tool:
    """A mirrored pair of finger extensions, with the head at the pose ``at`` in the frame of the tool mount."""
    assembly = Assembly(True, thickness)
    for piece, is_left in zip(head.pieces, (True, False), strict=True):
        pad = pose @ piece.pose
        hold = pad.position + np.array([0.0, 0.0, piece.size[2] / 2 - 0.003])
        last = assembly.shaft("gantry", hold, left=is_left)
        assembly.add(piece.name, last, pad, piece.size, (0.90, 0.49, 0.13, 1.0))
    reach = float(np.linalg.norm(pose.position))
    text = f"two pads {head.width:.3f} m apart, {reach:.2f} m from the hand, that close on the body"
    return assembly.tool("long_fingers", text)


def sample_pinch(errand: Errand, rng: np.random.Generator) -> Head:
    """Two plates that converge upward, farther apart than the body is wide below, and closer above.

    ``level`` is how far above the plates' lower ends the body's top is to be.
    """
    turn = float(rng.choice([0.0, np.pi / 2]))
    extent = errand.extent(turn)
    wide, long = extent.across, max(0.012, extent.along * float(rng.uniform(0.2, 0.6)))
    spare, press, lean = rng.uniform(0.0008, 0.0025), rng.uniform(0.0005, 0.003), rng.uniform(0.05, 0.14)
    level = float((spare + press) / np.tan(lean))
    thick, tall = float(rng.uniform(0.003, 0.006)), level + float(rng.uniform(0.004, 0.015))
    pieces = [box("bridge", 0.0, 0.0, tall + _BRIDGE_M / 2, (long, wide + 2 * (spare + thick), _BRIDGE_M))]
    for name, side in SIDES:
        # Its inner face leans inward from the lower edge, which is half the body's width and ``spare`` from the middle.
        edge = Pose.xyz_rpy((0.0, side * (wide / 2 + spare), 0.0), (side * lean, 0.0, 0.0))
        high = tall / np.cos(lean)
        pieces.append(box(f"{name}_plate", 0.0, side * thick / 2, high / 2, (long, thick, high), turn=edge))
    hold = np.array([0.0, 0.0, tall + _BRIDGE_M - 0.003])
    return Head("pinch", "pinch", tuple(pieces), hold, long, wide, level=level, turn=turn)


def pinch(path: Path, errand: Errand, head: Head, rng: np.random.Generator) -> str:
    """Come down over the body, press the plates on, and lift."""
    top = np.array([*errand.center[:2], float(errand.upper[2])])
    low = top - head.level * UP
    above = low + max(0.03, errand.clear_z - low[2] + rng.uniform(0.01, 0.05)) * UP
    path.go(head.turn, above, top + 0.01 * UP)
    path.go(head.turn, low, touch=True)
    rise = float(errand.shift[2]) + rng.uniform(0.0, 0.03)
    path.stroke(low + 0.02 * UP, head.turn, 0.1)
    path.stroke(low + rise * UP, head.turn, rng.uniform(0.1, 0.3))
    return f"presses two plates over the body and lifts it by {rise:.2f} m"


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


def handles(thing: Thing, space: Workspace) -> Handles | None:
    """The handles that are easiest to reach from the arm's side; None if there are none."""
    away = space.direction(thing.position)
    turns = sorted(np.arange(4) * np.pi / 2, key=lambda turn: -np.cos(turn - away))
    options = (_handles(thing, float(heading)) for heading in turns[:2])
    return next((option for option in options if option is not None), None)


def _handles(thing: Thing, heading: float) -> Handles | None:
    boxes = thing.boxes
    middle = (thing.points.min(axis=0) + thing.points.max(axis=0)) / 2
    ahead, side = axes_of(heading)
    right, left = boxes.extents(side, middle)
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
        float(boxes.extents(ahead, middle)[1][out].max()),
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
        box("plate", 0.005, 0.0, -drop / 2, (0.01, 0.06, drop + 0.07)),
        box("crossbar", _BACK_M - 0.005, 0.0, -drop, (0.01, width, 0.03)),
    ]
    along = _BACK_M - 0.002 + length / 2
    for name, sign in SIDES:
        height = thick + 2 * room + 2 * lip
        pieces.append(box(f"{name}_web", along, sign * (outer + lip / 2), -drop, (length + 0.002, lip, height), 1))
        for edge, up in (("lower", -1.0), ("upper", 1.0)):
            z, size = -drop + up * (thick / 2 + room + lip / 2), (length + 0.002, outer - inner + 0.002, lip)
            pieces.append(box(f"{name}_{edge}", along, sign * (inner + outer) / 2, z, size, 1))
    hold = np.array([0.0, 0.0, gap])
    return Head("fork", "pour", tuple(pieces), hold, length, width, level=drop)


def build_fork(head: Head) -> Tool:
    assembly = Assembly(False, 0.01)
    assembly.head(head, RIGID_MOUNT, FORK_POSE)
    text = f"two channels {head.width:.3f} m apart, {head.depth:.3f} m long, that slide over handles"
    return assembly.tool("handle_fork", text)


def pour(path: Path, errand: Errand, head: Head, rng: np.random.Generator) -> str:
    """Slide over the handles of the bodies' container, lift it, carry it to the goal, and turn it over there."""
    grips = handles(errand.holder, errand.space) if errand.holder is not None else None
    if errand.holder is None or grips is None:
        raise ValueError("a fork for handles needs a container with handles")
    gap, ahead = float(head.hold[2]), axes_of(grips.heading)[0]
    level = (grips.low + grips.high) / 2 + head.level
    grasp = grips.middle + (grips.rear - gap - _BACK_M) * ahead
    grasp[2] = level
    before = grasp - (head.depth + rng.uniform(0.01, 0.03)) * ahead
    path.go(grips.heading, before + rng.uniform(0.06, 0.15) * UP, before)
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
    ahead, side = axes_of(heading)
    there = place - (gap + _BACK_M - grips.rear) * ahead - sign * 0.5 * head.level * side
    there[2] = high
    path.stroke(there, heading, rng.uniform(0.15, 0.4))
    for share in np.linspace(0.0, 1.0, int(rng.integers(3, 7)) + 1)[1:]:
        path.add(Pose.xyz_rpy(there, (sign * share * turn, 0.0, heading)), touch=True)
    path.go(path.poses[-1], there + 0.02 * UP, there, there + 0.02 * UP, touch=True)
    carried = f"slides over the handles, lifts, carries by {errand.length:.2f} m"
    return f"{carried} and turns over by {np.degrees(turn):.0f} degrees"

"""Lift a body out of a narrow place without a gripper: two plates, pressed over it, hold it by friction."""

from __future__ import annotations

import numpy as np

from core.geometry import Pose
from plugins.vlms.offline.heads import Head, Piece
from plugins.vlms.offline.plans import Path
from plugins.vlms.offline.scene_analysis import UP, Errand

_BRIDGE_M = 0.008  # thickness of what joins the plates


def sample_pinch(errand: Errand, rng: np.random.Generator) -> Head:
    """Two plates that converge upward, farther apart than the body is wide below, and closer above.

    ``level`` is how far above the plates' lower ends the body's top is to be.
    """
    turn = float(rng.choice([0.0, np.pi / 2]))
    right, left = errand.span(turn + np.pi / 2)
    rear, front = errand.span(turn)
    wide, long = left - right, max(0.012, (front - rear) * float(rng.uniform(0.2, 0.6)))
    spare, press, lean = rng.uniform(0.0008, 0.0025), rng.uniform(0.0005, 0.003), rng.uniform(0.05, 0.14)
    level = float((spare + press) / np.tan(lean))
    thick, tall = float(rng.uniform(0.003, 0.006)), level + float(rng.uniform(0.004, 0.015))
    bridge = Pose(np.array([0.0, 0.0, tall + _BRIDGE_M / 2]))
    pieces = [Piece("bridge", bridge, (long, wide + 2 * (spare + thick), _BRIDGE_M))]
    for name, side in (("left_plate", 1.0), ("right_plate", -1.0)):
        # Its inner face leans inward from the lower edge, which is half the body's width and ``spare`` from the middle.
        edge = Pose.xyz_rpy((0.0, side * (wide / 2 + spare), 0.0), (side * lean, 0.0, 0.0))
        middle = Pose(np.array([0.0, side * thick / 2, tall / np.cos(lean) / 2]))
        pieces.append(Piece(name, edge @ middle, (long, thick, tall / np.cos(lean))))
    hold = np.array([0.0, 0.0, tall + _BRIDGE_M - 0.003])
    return Head("pinch", "pinch", tuple(pieces), hold, long, wide, level=level, turn=turn)


def pinch(path: Path, errand: Errand, head: Head, rng: np.random.Generator) -> str:
    """Come down over the body, press the plates on, and lift."""
    top = np.array([*errand.center[:2], float(errand.upper[2])])
    low = top - head.level * UP
    path.go(low + max(0.03, errand.clear_z - low[2] + rng.uniform(0.01, 0.05)) * UP, head.turn)
    path.go(top + 0.01 * UP, head.turn)
    path.go(low, head.turn, touch=True)
    rise = float(errand.shift[2]) + rng.uniform(0.0, 0.03)
    path.stroke(low + 0.02 * UP, head.turn, 0.1)
    path.stroke(low + rise * UP, head.turn, rng.uniform(0.1, 0.3))
    return f"presses two plates over the body and lifts it by {rise:.2f} m"

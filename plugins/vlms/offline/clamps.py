"""Finger extensions that close on a body."""

from __future__ import annotations

import numpy as np

from core.design import Tool
from core.geometry import Pose
from plugins.vlms.offline.heads import Head, Piece
from plugins.vlms.offline.scene_analysis import Errand
from plugins.vlms.offline.tools import FINGER_OPEN, Assembly


def sample_clamp(errand: Errand, rng: np.random.Generator) -> Head:
    """Two pads, a little farther apart than the bodies are wide, that close by twice the fingers' travel."""
    right, left = errand.span(np.pi / 2)
    rear, front = errand.span(0.0)
    tall = float(errand.upper[2] - errand.lower[2])
    gap = left - right + rng.uniform(0.01, min(0.06, 2 * FINGER_OPEN - 0.01))
    thick = rng.uniform(0.006, 0.014)
    long = (front - rear) * rng.uniform(0.3, 1.2)
    if errand.deep:  # there is little clearance beside them
        gap, thick, long = left - right + rng.uniform(0.006, 0.025), thick / 2, (front - rear) * rng.uniform(0.15, 0.4)
    size = (max(0.012, long), thick, float(np.clip(tall * rng.uniform(0.5, 1.3), 0.02, 0.12)))
    pieces = tuple(
        Piece(f"{name}_pad", Pose(np.array([0.0, side * (gap + thick) / 2, size[2] / 2])), size)
        for name, side in (("left", -1.0), ("right", 1.0))
    )
    return Head("clamp", "clamp", pieces, np.array([0.0, (gap + thick) / 2, size[2]]), size[0] / 2, gap)


def build_clamp(head: Head, at: Pose, thickness: float) -> Tool:
    """A mirrored pair of finger extensions, with the head at the pose ``at`` in the frame of the tool mount."""
    assembly = Assembly(True, thickness)
    for piece, is_left in zip(head.pieces, (True, False), strict=True):
        pad = at @ piece.pose
        hold = pad.position + np.array([0.0, 0.0, piece.size[2] / 2 - 0.003])
        last = assembly.shaft("gantry", hold, left=is_left)
        assembly.add(piece.name, last, pad, piece.size, (0.90, 0.49, 0.13, 1.0))
    reach = float(np.linalg.norm(at.position))
    text = f"two pads {head.width:.3f} m apart, {reach:.2f} m from the hand, that close on the body"
    return assembly.tool("long_fingers", text)

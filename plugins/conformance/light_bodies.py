"""Check bodies that weigh next to nothing: friction and gravity act on them as on any other."""

from __future__ import annotations

import numpy as np

from core.geometry import Pose
from core.interfaces import Simulator
from core.scene import Body, Box, Geom, Scene, table
from plugins.conformance.cases import play
from plugins.conformance.checking import near

_SPEED_M_S = 0.7746
_FRICTION = 0.18  # of the body; the table's is 0.5


def check_light_bodies_slide_as_heavy_ones(simulator: Simulator) -> None:
    """A box of 1 mg slides by the square of its speed over twice the friction and gravity: 0.102 m."""
    part = (Geom(Box((0.02, 0.02, 0.01))),)
    there = Pose(np.array([0.7, 0.3, 0.005]))
    box = Body("box", there, 1e-6, part, part, _FRICTION, velocity=(_SPEED_M_S, 0, 0))
    played = play(simulator, Scene((table(), box)), 1.0, settle_s=0.1)

    way = played.states.position("box")[-1] - there.position
    friction = np.sqrt(_FRICTION * 0.5)
    due = _SPEED_M_S**2 / (2 * friction * 9.81)
    near("how far a box of 1 mg slides, m", way, [due, 0.0, 0.0], 0.003)

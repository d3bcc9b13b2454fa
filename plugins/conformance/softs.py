"""Check soft bodies: they sag, bend, give way and come to rest as formulas say. An engine without them is left out."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from core.geometry import Array, Box, Pose, Sphere
from core.interfaces import Rollout, Simulator
from core.scene import Body, Cloth, Elastic, Filling, Form, Joint, Rope, Soft
from plugins.conformance.checking import between, near
from plugins.conformance.worlds import BARE, FAR, GRAVITY, GREY, cube, end, film, ground, run, still, wait

_SIDE, _LOAD_KG = 0.06, 1.0  # of a soft cube, and of what lies on it


def soft(form: Form, elastic: Elastic, height: float, pinned: tuple[int, ...] = ()) -> Soft:
    return Soft.make("soft", form, elastic, Pose(np.array([FAR[0], FAR[1], height])), color=GREY, pinned=pinned)


def nodes(simulator: Simulator, *bodies: Body, seconds: float, joints: tuple[Joint, ...] = ()) -> Array:
    """Let bodies come to rest; return the nodes (N, 3) of the soft one."""
    return end(run(simulator, bodies, Rollout(BARE, still(), 0, 0.0, seconds), joints)).nodes("soft")


def rope_sag(simulator: Simulator) -> tuple[float, float]:
    """Hang a limp rope between its ends; return its sag, and that of a catenary."""
    span, length, count = 0.3, 0.4, 21
    low = math.sqrt(length**2 - span**2) / 2
    rope = Rope(((-span / 2, 0.0, 0.0), (0.0, 0.0, -low), (span / 2, 0.0, 0.0)), count, thickness=0.004)
    found = nodes(simulator, soft(rope, Elastic(900, 1e5, damping=0.5), 1.0, (0, count - 1)), seconds=5.0)
    curve = brentq(lambda a: 2 * a * math.sinh(span / 2 / a) - length, 0.02, 10.0)
    return 1.0 - float(found[:, 2].min()), curve * (math.cosh(span / 2 / curve) - 1)


def cloth_sag(simulator: Simulator) -> tuple[float, float]:
    """Hold a flat cloth at two opposite edges; return its sag, and that of an elastic membrane's parabola."""
    span, rows, across, elastic = 0.3, 13, 5, Elastic(300, 1e5, poisson=0.0)
    edges = (*range(across), *range((rows - 1) * across, rows * across))
    found = nodes(simulator, soft(Cloth((span, 0.1), (rows, across)), elastic, 1.0, edges), seconds=3.0)
    due = span * (3 * elastic.density * GRAVITY * span / (64 * elastic.young)) ** (1 / 3)
    return 1.0 - float(found[:, 2].min()), due


def rod_bend(simulator: Simulator) -> tuple[float, float]:
    """Clamp a rod at two nodes; return how far its end sinks, and what Euler and Bernoulli say."""
    length, wide, count, elastic = 0.3, 0.02, 31, Elastic(1000, 1e7)
    rope = Rope(((0.0, 0.0, 0.0), (length, 0.0, 0.0)), count, thickness=wide)
    found = nodes(simulator, soft(rope, elastic, 1.0, (0, 1)), seconds=3.0)
    free = length - length / (count - 1) / 2  # from the middle of the clamped segment
    load, stiffness = elastic.density * GRAVITY * math.pi * wide**2 / 4, elastic.young * math.pi * wide**4 / 64
    return 1.0 - float(found[-1, 2]), load * free**4 / (8 * stiffness)


def cube_squeeze(simulator: Simulator) -> tuple[float, float]:
    """Lay a weight on a soft cube without friction; return how much flatter it gets, and what Hooke says."""
    elastic, skin = Elastic(300, 1e5, friction=0.0), 0.001
    body = soft(Filling(Box((_SIDE, _SIDE, _SIDE))), elastic, _SIDE / 2 + skin)
    load = cube("load", (FAR[0], FAR[1], _SIDE + 2 * skin + 0.05), 0.1, _LOAD_KG)
    guide = Joint("guide", "slider", "load")
    found = nodes(simulator, body, ground(), load, seconds=2.0, joints=(guide,))[:, 2]
    order = body.form.nodes[:, 2]
    flat = found[order > _SIDE / 2 - 1e-6].mean() - found[order < 1e-6 - _SIDE / 2].mean()
    own = elastic.density * _SIDE / 2
    return _SIDE - float(flat), _SIDE * GRAVITY / elastic.young * (_LOAD_KG / _SIDE**2 + own)


FORMULAS = [  # what is measured, and the share of it that is allowed
    ("the sag of a rope, m", rope_sag, 0.05),
    ("the sag of a cloth, m", cloth_sag, 0.05),
    ("how far the end of a rod sinks, m", rod_bend, 0.1),
    ("by how much a weight squeezes a soft cube, m", cube_squeeze, 0.1),
]


def check_soft_bodies_sag_and_give_way(simulator: Simulator) -> None:
    for what, measure, share in FORMULAS:
        found, due = measure(simulator)
        near(what, found, due, share * due)


def check_dropped_soft_ball_loses_energy(simulator: Simulator) -> None:
    """It never gets as high again as it was, and comes to rest on the ground."""
    ball = soft(Filling(Sphere(0.04)), Elastic(300, 5e4), 0.24)
    states = film(wait(simulator, ball, ground(), seconds=2.0, record_hz=100)).states
    heights = states.position("soft")[:, 2] - 0.04
    landed = int((heights < 0.01).argmax())
    between("how high a soft ball bounces that was dropped from 0.2 m, m", heights[landed:].max(), high=0.16)
    near("the velocity of a soft ball 2 s after it was dropped, m/s", states.linear_velocity("soft")[-1], 0.0, 0.02)

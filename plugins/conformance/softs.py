"""Check soft bodies: they sag, bend, give way and come to rest as formulas say. An engine without them is left out."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from core.geometry import Array, Box, Pose, Sphere
from core.interfaces import Rollout, Simulator
from core.scene import Body, Cloth, Elastic, Filling, Form, Joint, Rope, Soft
from plugins.conformance.checking import expect
from plugins.conformance.worlds import BARE, FAR, GRAVITY, GREY, cube, end, film, near, run, still, wait

_SIDE, _LOAD_KG = 0.06, 1.0  # of a soft cube, and of what lies on it


def soft(form: Form, elastic: Elastic, height: float, pinned: tuple[int, ...] = ()) -> Soft:
    return Soft.make("soft", form, elastic, Pose(np.array([FAR[0], FAR[1], height])), color=GREY, pinned=pinned)


def nodes(simulator: Simulator, *bodies: Body, seconds: float, joints: tuple[Joint, ...] = ()) -> Array:
    """Let bodies come to rest; return the nodes (N, 3) of the soft one."""
    return end(run(simulator, bodies, Rollout(BARE, still(), 0, 0.0, seconds), joints)).nodes("soft")


def _ground() -> Body:
    return Body.of("ground", Box((1.0, 1.0, 0.1)), (FAR[0], FAR[1], -0.05), mass=0.0, color=GREY)


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
    found = nodes(simulator, body, _ground(), load, seconds=2.0, joints=(guide,))[:, 2]
    order = body.form.nodes[:, 2]
    flat = found[order > _SIDE / 2 - 1e-6].mean() - found[order < 1e-6 - _SIDE / 2].mean()
    own = elastic.density * _SIDE / 2
    return _SIDE - float(flat), _SIDE * GRAVITY / elastic.young * (_LOAD_KG / _SIDE**2 + own)


def check_rope_and_cloth_sag(simulator: Simulator) -> None:
    near(*rope_sag(simulator), "a rope sags by", "m", 0.05)
    near(*cloth_sag(simulator), "a cloth sags by", "m", 0.05)


def check_rod_bends(simulator: Simulator) -> None:
    near(*rod_bend(simulator), "the end of a rod sinks by", "m", 0.1)


def check_soft_cube_gives_way(simulator: Simulator) -> None:
    near(*cube_squeeze(simulator), "a soft cube under a weight is squeezed by", "m", 0.1)


def check_dropped_soft_ball_loses_energy(simulator: Simulator) -> None:
    """It never gets as high again as it was, and comes to rest on the ground."""
    ball, high = soft(Filling(Sphere(0.04)), Elastic(300, 5e4), 0.24), 0.2
    recording = film(wait(simulator, ball, _ground(), seconds=2.0, record_hz=100))
    heights = recording.states.position("soft")[:, 2] - 0.04
    landed = int((heights < 0.01).argmax())
    expect(landed > 0, "a soft ball that is dropped does not land")
    expect(heights[landed:].max() < 0.8 * high, f"a soft ball bounces to {heights[landed:].max():.3f} m of {high} m")
    speed = float(np.abs(recording.states.linear_velocity("soft")[-1]).max())
    expect(speed < 0.02, f"a soft ball that was dropped still moves at {speed:.3f} m/s")

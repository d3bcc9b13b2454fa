"""Check soft bodies: they sag, bend, give way and come to rest as formulas say. An engine without them is left out."""

from __future__ import annotations

import math

import numpy as np

from core.geometry import Array, Box, Pose
from core.interfaces import Rollout, Simulator
from core.scene import Body, Elastic, Filling, Form, Joint, Rope, Soft
from plugins.conformance.checking import near
from plugins.conformance.worlds import BARE, FAR, GRAVITY, GREY, cube, end, ground, run, still

_SIDE, _LOAD_KG = 0.06, 1.0  # of a soft cube, and of what lies on it


def soft(form: Form, elastic: Elastic, height: float, pinned: tuple[int, ...] = ()) -> Soft:
    return Soft.make("soft", form, elastic, Pose(np.array([FAR[0], FAR[1], height])), color=GREY, pinned=pinned)


def nodes(simulator: Simulator, *bodies: Body, seconds: float, joints: tuple[Joint, ...] = ()) -> Array:
    """Let bodies come to rest; return the nodes (N, 3) of the soft one."""
    return end(run(simulator, bodies, Rollout(BARE, still(), 0, 0.0, seconds), joints)).nodes("soft")


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


def check_soft_bodies_bend_and_give_way(simulator: Simulator) -> None:
    for what, measure in (("a rod's end sinks", rod_bend), ("a weight squeezes a soft cube", cube_squeeze)):
        found, due = measure(simulator)
        near(f"by how much {what}, m", found, due, 0.1 * due)

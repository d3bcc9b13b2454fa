"""Rollouts of a few bodies, written by hand, for what looks at recordings."""

import numpy as np

from core.design import Component, Tool
from core.geometry import Box, Pose
from core.interfaces import (
    Recording,
)
from core.scene import Body, State
from core.solids.penetration import findings
from tests.support.panda import ARM, PANDA

HZ = 25.0


ROD = Tool(
    (
        Component(
            "rod",
            "tool_mount",
            Pose.xyz_rpy((0.0, 0.0, -0.1)),
            Box((0.02, 0.02, 0.2)),
        ),
    )
)


GREY = (0.5, 0.5, 0.5, 1.0)


def body(name, shape, position, mass=0.1, rpy=(0, 0, 0)):
    return Body.of(name, shape, position, mass=mass, color=GREY, rpy=rpy)


WALL = body("wall", Box((0.01, 0.5, 0.5)), (0.5, 0.0, 0.25), mass=0.0)


def recording(scene, paths, hz=HZ, arms=None, quaternions=None, velocities=None):
    """Record free bodies at ``paths`` (T, 3), by name; the arm is far from them by default (``arms``: (T, 7))."""
    count = len(arms) if arms is not None else len(next(iter(paths.values())))
    away = np.tile([2.8, *ARM.home[1:]], (count, 1))
    names = tuple(free.name for free in scene.free)

    def series(given, default):
        """Values by name, or the default (T, free bodies, numbers)."""
        rows = [
            np.broadcast_to(given.get(n, default), (count, len(default))) for n in names
        ]
        return np.stack(rows, axis=1) if rows else np.zeros((count, 0, len(default)))

    states = State(
        names,
        series(paths, (0.0, 0.0, 0.0)),
        series(quaternions or {}, (1.0, 0.0, 0.0, 0.0)),
        series(velocities or {}, (0.0, 0.0, 0.0)),
        np.zeros((count, len(names), 3)),
    )
    return Recording(
        np.arange(count) / hz,
        arms if arms is not None else away,
        np.zeros((count, 2)),
        states,
    )


def straight(start, end, count):
    return np.linspace(start, end, count)


def penetrations(scene, taken, tool=ROD):
    return [
        finding.text
        for finding in findings(scene, PANDA, tool, taken)
        if finding.penetration
    ]

"""Keep an episode for rewards that read its trace."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.design import Tool
from core.interfaces import Recording, Robot, World
from core.scene import Scene, State, Trace
from core.solids.contacts import find_contacts, make_trace
from core.values.traces import TRACE_HZ

SETTLE_S = 0.5
"""Before the first action."""


class Film:
    """Keeps the instants of an episode, for rewards that read its trace.

    `add` is called in each step of the engine, and `trace` whenever the reward is computed.

    Args:
        scene: of the episode.
        robot: the arm.
        tool: what it holds.
    """

    def __init__(self, scene: Scene, robot: Robot, tool: Tool) -> None:
        self._scene = scene
        self._robot = robot
        self._tool = tool
        self._instants: list[Recording] = []

    def add(self, seconds: float, world: World) -> None:
        """Keep the world as it is, ``seconds`` after the first action could be, if the next instant has come."""
        if (seconds + SETTLE_S) * TRACE_HZ >= len(self._instants):
            self._instants.append(_record(seconds, world))

    def trace(self, seconds: float, world: World) -> Trace:
        """Return the trace of the episode until now, without forces, which steps don't measure."""
        instants = [*self._instants, _record(seconds, world)]
        recording = Recording(
            times=np.array([instant.times for instant in instants]),
            arm=np.array([instant.arm for instant in instants]),
            fingers=np.array([instant.fingers for instant in instants]),
            states=State.stack([instant.states for instant in instants]),
        )
        contacts = find_contacts(self._scene, self._robot, self._tool, recording)
        trace = make_trace(self._scene, contacts)

        return replace(trace, forces=None, strains={})


def _record(seconds: float, world: World) -> Recording:
    arm, fingers = world.joints()
    return Recording(np.array(seconds), arm, fingers, world.state())

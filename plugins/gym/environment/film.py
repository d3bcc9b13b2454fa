"""Keep an episode for rewards that read its trace."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.design import Tool
from core.geometry import Array
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
        self._instants: list[tuple[float, Array, Array, State]] = []

    def add(self, seconds: float, world: World) -> None:
        """Keep the world as it is, ``seconds`` after the first action could be, if the next instant has come."""
        if (seconds + SETTLE_S) * TRACE_HZ >= len(self._instants):
            self._instants.append((seconds, *world.joints(), world.state()))

    def trace(self, seconds: float, world: World) -> Trace:
        """Return the trace of the episode until now, without forces, which steps don't measure."""
        now = (seconds, *world.joints(), world.state())
        times, arm, fingers, states = zip(*self._instants, now, strict=True)
        recording = Recording(
            np.array(times), np.array(arm), np.array(fingers), State.stack(states)
        )
        contacts = find_contacts(self._scene, self._robot, self._tool, recording)
        return replace(make_trace(self._scene, contacts), forces=None, strains={})

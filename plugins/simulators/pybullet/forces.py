"""Sum up the contact forces of a rollout."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from plugins.simulators.forces import TOOL, Impulses, Thing
from plugins.simulators.pybullet.engine import pybullet as p


class Forces(Impulses):
    """The impulses of a world; ``things`` maps PyBullet's numbers of a body and its link to what they are."""

    def __init__(self, client: int, things: Mapping[tuple[int, int], Thing], time_step: float) -> None:
        super().__init__()
        self._client, self._things, self._time_step = client, things, time_step

    def add_step(self) -> None:
        """Add those of the last step."""
        for point in p.getContactPoints(physicsClientId=self._client):
            one, other = self._things[point[1], point[3]], self._things[point[2], point[4]]
            self.add(one, other, point[9] * self._time_step)
            if TOOL in (one, other):
                force = point[9] * np.array(point[7])  # and friction, along two directions
                force += point[10] * np.array(point[11]) + point[12] * np.array(point[13])
                self.push(one, other, point[5], force * self._time_step)

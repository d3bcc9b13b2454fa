"""Sum up the contact forces of a rollout."""

from __future__ import annotations

from collections.abc import Mapping

from core.simulation.playback import Impulses, Thing
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

"""Sum up the contact forces of a rollout."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from core.geometry import Array
from plugins.simulators.pybullet.engine import pybullet as p

Thing = tuple[int, str]  # a rank, and a name; the robot's things have rank -1, bodies theirs in the scene


class Forces:
    """The normal impulses since the world began, for each two things that touched."""

    def __init__(self, client: int, things: Mapping[tuple[int, int], Thing], time_step: float) -> None:
        """``things`` maps PyBullet's numbers of a body and its link to what they are."""
        self._client, self._things, self._time_step = client, things, time_step
        self._impulses: dict[tuple[str, str], float] = {}
        self._noted: list[dict[tuple[str, str], float]] = []

    def add(self) -> None:
        """Add those of the last step."""
        for point in p.getContactPoints(physicsClientId=self._client):
            if point[9] > 0:
                one, other = sorted((self._things[point[1], point[3]], self._things[point[2], point[4]]))
                if other[0] > one[0]:
                    pair = one[1], other[1]
                    self._impulses[pair] = self._impulses.get(pair, 0.0) + point[9] * self._time_step

    def note(self) -> None:
        """Note the impulses at an instant of the recording."""
        self._noted.append(dict(self._impulses))

    def means(self, times: Array) -> dict[tuple[str, str], Array]:
        """Compute the mean force between instants (T,), see `core.interfaces.Recording`."""
        found = {}
        for pair in self._impulses:
            sums = np.array([noted.get(pair, 0.0) for noted in self._noted])
            found[pair] = np.append(0.0, np.diff(sums) / np.diff(times))
        return found

"""Sum up the contact forces of a rollout."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from core.geometry import Array
from plugins.simulators.forces import Impulses, Thing, meeting
from plugins.simulators.pybullet.engine import Client
from plugins.simulators.pybullet.mechanisms import Place


def pushes(client: Client, robot: int, links: Collection[int]) -> tuple[Array, Array]:
    """Return what pushed some links of the robot in the last step, see `core.interfaces.World.pushes`.

    Args:
        client: the world.
        robot: PyBullet's number of the robot.
        links: those of the links; what they press on each other with is left out.
    """
    points = []
    forces = []
    for contact in client.getContactPoints():
        first = contact[1] == robot and contact[3] in links
        second = contact[2] == robot and contact[4] in links
        if first == second:
            continue

        sign = 1.0 if first else -1.0
        points.append(contact[5])
        forces.append(sign * _force(contact))

    return np.reshape(points, (-1, 3)), np.reshape(forces, (-1, 3))


def _force(contact: Sequence[Any]) -> Array:
    """Return the force (3,) of a contact point on its first body, with friction along two directions."""
    normal = contact[9] * np.array(contact[7])
    friction = contact[10] * np.array(contact[11])
    across = contact[12] * np.array(contact[13])

    force: Array = normal + friction + across
    return force


class Forces(Impulses):
    """The impulses of a world.

    Args:
        client: the world.
        things: what each place is: PyBullet's numbers of a body and its link.
        time_step: seconds.
    """

    def __init__(
        self, client: Client, things: Mapping[Place, Thing], time_step: float
    ) -> None:
        super().__init__()
        self._client = client
        self._things = things
        self._time_step = time_step

    def add_step(self) -> None:
        for point in self._client.getContactPoints():
            first = self._things[point[1], point[3]]
            met = meeting(first, self._things[point[2], point[4]])
            self.add(met, point[9] * self._time_step)
            if met.body:
                impulse = _force(point) * self._time_step
                self.push(met, point[5], impulse)

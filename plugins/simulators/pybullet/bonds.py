"""Hold bodies by bonds in PyBullet: constraints of points."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from core.geometry import Array, Pose
from core.scene import Scene
from plugins.simulators import bonds
from plugins.simulators.pybullet.engine import Client
from plugins.simulators.pybullet.mechanisms import Place

# N, far more than any bond bears: PyBullet's own constraints give way at 500 N.
_HOLDS = 1e6


class Bonds(bonds.Bonds):
    """The bonds of a world.

    Args:
        client: the world, its bodies at their initial poses.
        scene: has the bonds.
        places: of the bodies, by name.
        offsets: of the free bodies' frames in those of their centres of mass.
    """

    def __init__(
        self,
        client: Client,
        scene: Scene,
        places: Mapping[str, Place],
        offsets: Mapping[str, Pose],
    ) -> None:
        super().__init__(scene.bonds)
        self._client = client
        self._numbers: list[int] = []

        for bond in scene.bonds:
            body, link = places[bond.body]
            point = offsets[bond.body].apply(bond.origin)
            other = (-1, -1)
            there = scene.find_anchor(bond)
            if bond.parent is not None and scene[bond.parent].fixed:
                there = scene[bond.parent].pose.apply(there)
            elif bond.parent is not None:
                other = places[bond.parent]
                there = offsets[bond.parent].apply(there)

            number = client.createConstraint(
                body,
                link,
                *other,
                client.JOINT_POINT2POINT,
                [0, 0, 0],
                list(point),
                list(there),
            )
            client.changeConstraint(number, maxForce=_HOLDS)
            self._numbers.append(number)

    def measure(self) -> Array:
        forces = np.zeros(len(self._numbers))
        for k in np.flatnonzero(self._holds).tolist():
            force = self._client.getConstraintState(self._numbers[k])
            forces[k] = np.linalg.norm(force)

        return forces

    def release(self, number: int) -> None:
        self._client.removeConstraint(self._numbers[number])

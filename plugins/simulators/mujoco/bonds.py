"""Hold bodies by bonds in MuJoCo: equality constraints of points, which are switched off."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from core.geometry import Array
from core.scene import Scene
from plugins.simulators import bonds
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.robot import HOLDS
from plugins.simulators.mujoco.shapes import Element

_EQUALITY = int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)


def add_bonds(spec: Element, scene: Scene, bearers: Mapping[str, Element]) -> None:
    """Add a scene's bonds, as `_name` calls them.

    Args:
        spec: what they are added to.
        scene: has them.
        bearers: the spec's body for each body of the scene, by name.
    """
    for number, bond in enumerate(scene.bonds):
        other = spec.worldbody
        if bond.parent is not None:
            other = bearers[bond.parent]

        element = spec.add_equality(
            name=_name(number),
            type=mujoco.mjtEq.mjEQ_CONNECT,
            objtype=mujoco.mjtObj.mjOBJ_BODY,
            name1=bearers[bond.body].name,
            name2=other.name,
        )
        element.data[:3] = bond.origin
        element.solref = [2 * spec.option.timestep, 1.0]
        element.solimp = HOLDS


def _name(number: int) -> str:
    """Name a bond in the spec, by its number."""
    return f"bond_{number}"


class Bonds(bonds.Bonds):
    """The bonds of a world.

    Args:
        scene: has the bonds.
        model: compiled with `add_bonds`.
        data: the world's.
    """

    def __init__(self, scene: Scene, model: Element, data: Element) -> None:
        super().__init__(scene.bonds)
        self._data = data
        count = range(len(scene.bonds))
        self._numbers = [model.equality(_name(number)).id for number in count]

    def measure(self) -> Array:
        data = self._data
        equal = data.efc_type == _EQUALITY
        forces = []
        for number in self._numbers:
            rows = equal & (data.efc_id == number)
            forces.append(float(np.linalg.norm(data.efc_force[rows])))

        return np.array(forces)

    def release(self, number: int) -> None:
        self._data.eq_active[self._numbers[number]] = 0

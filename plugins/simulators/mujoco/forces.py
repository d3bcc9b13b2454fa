"""Measure the normal forces between things in a world that is stepped."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from core.geometry import Array
from core.scene import Scene
from plugins.simulators.mujoco.contacts import Role
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.shapes import Element

Numbers = npt.NDArray[np.int64]

_AWAKE = int(mujoco.mjtSleepState.mjS_AWAKE)  # as a number: an array is compared with an enum one by one


class Measured(NamedTuple):
    """The contacts of a step: the two things of each by number (C, 2), the smaller first, and normal forces (C,)."""

    pairs: Numbers
    forces: Array


class Meter:
    """Measure what things press on each other with: the tool and the arm's links first, then the scene's bodies.

    ``steps`` are the steps measured so far.
    """

    def __init__(self, scene: Scene, model: Element) -> None:
        owners = [model.geom(number).name.partition("/")[2] for number in range(model.ngeom)]
        robot = model.geom_contype != Role.SCENE.value[0]
        links = sorted({owner for owner, own in zip(owners, robot, strict=True) if own})
        bodies = [body.name for body in scene.bodies]
        self._names, self._links = [*links, *bodies], len(links)
        self._owners = np.array(
            [
                links.index(owner) if own else len(links) + bodies.index(owner)
                for owner, own in zip(owners, robot, strict=True)
            ]
        )
        self.steps: list[Measured] = []
        self._bodies = np.full(len(self._names), -1)  # the model's, of bodies in the scene
        self._bodies[self._owners[~robot]] = model.geom_bodyid[~robot]

    def measure(self, data: Element) -> None:
        """Measure the contacts of the last step; things that sleep press on each other as they did before it."""
        before = self.steps[-1] if self.steps else Measured(np.zeros((0, 2), dtype=np.int64), np.zeros(0))
        contact = data.contact
        acts = contact.efc_address >= 0
        pairs = np.sort(self._owners[contact.geom[acts]], axis=1)
        forces = data.efc_force[contact.efc_address[acts]]  # of an elliptic cone the first row is the normal
        awake = np.where(self._bodies < 0, True, data.body_awake[self._bodies] == _AWAKE)
        kept, new = ~awake[before.pairs].any(axis=1), awake[pairs].any(axis=1) & (pairs[:, 1] >= self._links)
        joined = zip((before.pairs[kept], before.forces[kept]), (pairs[new], forces[new]), strict=True)
        self.steps.append(Measured(*(np.concatenate(both) for both in joined)))

    def means(self, at: Numbers) -> Mapping[tuple[str, str], Array]:
        """Average the forces of all steps between the instants before steps ``at`` (T,): (T,) for each pair."""
        if not self.steps:
            return {}
        counts = [len(one.forces) for one in self.steps]
        interval = np.searchsorted(at, np.repeat(np.arange(len(counts)), counts), side="right")
        pairs, forces = (np.concatenate(parts) for parts in zip(*self.steps, strict=True))
        spans = np.diff(at, prepend=at[0] - 1)
        found = {}
        for one, other in np.unique(pairs, axis=0).tolist():
            mine = (pairs == (one, other)).all(axis=1)
            sums = np.bincount(interval[mine], forces[mine], minlength=len(at))
            if sums.any():
                found[self._names[one], self._names[other]] = sums / spans
        return found

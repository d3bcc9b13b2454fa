"""Measure the normal forces between things in a world that is stepped."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from core.geometry import Array
from core.interfaces import Pushes, Recording
from core.scene import Scene
from plugins.simulators.mujoco.contacts import Role
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.shapes import Element

Numbers = npt.NDArray[np.int64]

_AWAKE = int(mujoco.mjtSleepState.mjS_AWAKE)  # as a number: an array is compared with an enum one by one


class Measured(NamedTuple):
    """The contacts of a step: the two things of each by number (C, 2), the smaller first, and normal forces (C,).

    Of the P contacts with the tool also the other thing (P,), the point (P, 3) and the force on the tool (P, 3).
    """

    pairs: Numbers
    forces: Array
    others: Numbers
    points: Array
    pushes: Array


_NOTHING = Measured(np.zeros((0, 2), np.int64), np.zeros(0), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))


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
        self._tool = links.index("tool") if "tool" in links else -1
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
        before = self.steps[-1] if self.steps else _NOTHING
        contact = data.contact
        acts = contact.efc_address >= 0
        owners = self._owners[contact.geom[acts]]
        pairs = np.sort(owners, axis=1)
        forces = data.efc_force[contact.efc_address[acts]]  # of an elliptic cone the first row is the normal
        awake = np.where(self._bodies < 0, True, data.body_awake[self._bodies] == _AWAKE)
        kept, new = ~awake[before.pairs].any(axis=1), awake[pairs].any(axis=1) & (pairs[:, 1] >= self._links)
        joined = np.concatenate([before.pairs[kept], pairs[new]]), np.concatenate([before.forces[kept], forces[new]])
        mine = (pairs[:, 0] == self._tool) & (pairs[:, 1] >= self._links)
        touching = np.flatnonzero(acts)[mine]
        rows = contact.efc_address[touching, None] + np.minimum(np.arange(3), contact.dim[touching, None] - 1)
        along = data.efc_force[rows] * (np.arange(3) < contact.dim[touching, None])  # without friction there is one
        on_second = np.einsum("pi,pij->pj", along, contact.frame[touching].reshape(-1, 3, 3))
        pushes = np.where(owners[mine, 1:] == self._tool, on_second, -on_second)
        self.steps.append(Measured(*joined, pairs[mine, 1], contact.pos[touching], pushes))

    def measured(self, recording: Recording, at: Numbers) -> Recording:
        """Add the mean forces between instants, before steps ``at`` (T,), to a recording."""
        if not self.steps:
            return recording
        kinds = [np.concatenate(parts) for parts in zip(*self.steps, strict=True)]
        pairs, forces, others, points, pushes = kinds
        interval, touching = (
            np.searchsorted(at, np.repeat(np.arange(len(self.steps)), counts), side="right")
            for counts in ([len(one.forces) for one in self.steps], [len(one.others) for one in self.steps])
        )
        spans = np.diff(at, prepend=at[0] - 1)
        found = {}
        for one, other in np.unique(pairs, axis=0).tolist():
            mine = (pairs == (one, other)).all(axis=1)
            sums = np.bincount(interval[mine], forces[mine], minlength=len(at))
            if sums.any():
                found[self._names[one], self._names[other]] = sums / spans
        bodies = np.array(self._names, dtype=np.str_)[others]
        return replace(recording, forces=found, pushes=Pushes(touching, bodies, points, pushes / spans[touching, None]))

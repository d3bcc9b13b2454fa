"""Measure the normal forces between things in a world that is stepped."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from core.geometry import Array
from core.interfaces import Pushes, Recording
from core.scene import Scene
from plugins.simulators.mujoco.contacts import Role
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.shapes import Element

Numbers = npt.NDArray[np.int64]

PACKED = 256  # steps whose contacts are packed at once
_AWAKE = int(
    mujoco.mjtSleepState.mjS_AWAKE
)  # as a number: an array is compared with an enum one by one
_OFF = int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
_NET = 3  # a sensor's way to make one of many contacts: the sum of the forces
# Of all contacts, and of those of the links with one another.
_OUTER = "pushes"
_INNER = "pushes within"


def add_feeler(spec: Element, link: str) -> None:
    """Add what a `Feeler` reads: sensors of the contacts of a link and of all that it moves. They are off at first."""
    kinds = mujoco.mjtObj
    fields = mujoco.mjtConDataField
    for name, other in (
        (_OUTER, {}),
        (_INNER, {"reftype": kinds.mjOBJ_XBODY, "refname": link}),
    ):
        kind = mujoco.mjtSensor.mjSENS_CONTACT
        sensor = spec.add_sensor(
            name=name, type=kind, objtype=kinds.mjOBJ_XBODY, objname=link, **other
        )
        sensor.intprm[:3] = (
            1 << int(fields.mjCONDATA_FORCE) | 1 << int(fields.mjCONDATA_POS),
            _NET,
            1,
        )
    spec.option.disableflags |= _OFF


class Feeler:
    """What pushes the robot beyond its last joint, see `core.values.jobs.FeelingWorld`."""

    def __init__(self, model: Element) -> None:
        self._model = model
        self._outer, self._inner = (
            int(model.sensor(name).adr[0]) for name in (_OUTER, _INNER)
        )

    @contextmanager
    def on(self) -> Iterator[None]:
        """Let the sensors measure."""
        self._model.opt.disableflags ^= _OFF
        try:
            yield
        finally:
            self._model.opt.disableflags ^= _OFF

    def pushes(self, sensed: Array) -> tuple[Array, Array]:
        """Return points (S, 3) and forces (S, 3), whose sum is the mean force in steps with these sensors' data (S, X).

        Contacts of stiff bodies chatter, so that one step alone may have none.
        """
        outer = sensed[:, self._outer :]
        inner = sensed[:, self._inner :]
        return outer[:, 3:6], (inner[:, :3] - outer[:, :3]) / len(sensed)


class Measured(NamedTuple):
    """The contacts of ``length`` steps in a row: of each the step (C,), the numbers of its two things (C, 2), the
    smaller first, and the normal force (C,). ``asleep`` (length, N) says which things slept.

    Of the P contacts with the tool also the step (P,), the other thing (P,), the point (P, 3) and the force on the tool
    (P, 3).
    """

    length: int
    steps: Numbers
    pairs: Numbers
    forces: Array
    asleep: npt.NDArray[np.bool_]
    touching: Numbers
    others: Numbers
    points: Array
    pushes: Array


class Meter:
    """Measure what things press on each other with: the tool and the arm's links first, then the scene's bodies.

    A step only copies what the engine says; `packed` has the contacts of many steps, and makes sense of them at once.
    """

    def __init__(self, scene: Scene, model: Element) -> None:
        owners = [
            model.geom(number).name.partition("/")[2] for number in range(model.ngeom)
        ]
        robot = model.geom_contype != Role.SCENE.value[0]
        links = sorted({owner for owner, own in zip(owners, robot, strict=True) if own})
        bodies = [body.name for body in scene.bodies]
        self._names = [*links, *bodies]
        self._links = len(links)
        self._tool = links.index("tool") if "tool" in links else -1
        self._owners = np.array(
            [
                links.index(owner) if own else len(links) + bodies.index(owner)
                for owner, own in zip(owners, robot, strict=True)
            ]
        )
        self._flexes = np.array(
            [len(links) + bodies.index(soft.name) for soft in scene.softs],
            dtype=np.int64,
        )
        self._packed: list[Measured] = []
        self._steps: list[tuple[npt.NDArray[Any], ...]] = []  # not packed yet
        self._bodies = np.full(
            len(self._names), -1
        )  # the model's, of bodies in the scene
        self._bodies[self._owners[~robot]] = model.geom_bodyid[~robot]
        for number, owner in enumerate(self._flexes):
            bearers = model.flex_vertbodyid[model.flex_vertadr[number] :][
                : model.flex_vertnum[number]
            ]
            self._bodies[owner] = bearers[bearers > 0][0]

    def begin(self, packed: Sequence[Measured]) -> None:
        """Begin anew, after steps that were measured before."""
        self._packed = [*packed]
        self._steps = []

    def measure(self, data: Element) -> None:
        """Copy the contacts of the last step."""
        contact = data.contact
        geoms = (
            contact.geom
            if not len(self._flexes)
            else np.where(contact.geom < 0, -1 - contact.flex, contact.geom)
        )
        where = (
            geoms.copy(),
            contact.efc_address.copy(),
            contact.dim.copy(),
            contact.frame.copy(),
            contact.pos.copy(),
        )
        self._steps.append((*where, data.efc_force.copy(), data.body_awake.copy()))
        if len(self._steps) == PACKED:
            self.packed()

    def packed(self) -> list[Measured]:
        """Return the contacts of all steps so far."""
        if self._steps:
            self._packed.append(self._pack())
            self._steps = []
        return self._packed

    def _pack(self) -> Measured:
        geoms, addresses, dims, frames, points, forces = (
            np.concatenate(parts)
            for parts in zip(*(step[:-1] for step in self._steps), strict=True)
        )
        counts, rows = (
            np.array([len(step[number]) for step in self._steps]) for number in (1, 5)
        )
        steps = np.repeat(np.arange(len(counts)), counts)
        first = addresses + np.repeat(
            np.cumsum(rows) - rows, counts
        )  # of an elliptic cone this row is the normal
        acts = addresses >= 0
        owners = np.append(self._owners, self._flexes[::-1])[
            geoms
        ]  # a flex has -1 minus its number
        pairs = np.sort(owners, axis=1)
        asleep = np.array([step[-1] for step in self._steps])[:, self._bodies] != _AWAKE
        asleep[:, self._bodies < 0] = False
        resting = asleep[steps, pairs[:, 0]] & asleep[steps, pairs[:, 1]]
        scene = acts & (pairs[:, 1] >= self._links)
        new = np.flatnonzero(scene & ~resting)
        mine = np.flatnonzero(scene & (pairs[:, 0] == self._tool))
        axes = np.arange(3)
        along = forces[first[mine, None] + np.minimum(axes, dims[mine, None] - 1)] * (
            axes < dims[mine, None]
        )
        on_second = np.einsum(
            "pi,pij->pj", along, frames[mine].reshape(-1, 3, 3)
        )  # without friction there is one row
        pushes = np.where(owners[mine, 1:] == self._tool, on_second, -on_second)
        each = steps[new], pairs[new], forces[first[new]], asleep
        return Measured(
            len(counts), *each, steps[mine], pairs[mine, 1], points[mine], pushes
        )

    def measured(self, recording: Recording, at: Numbers) -> Recording:
        """Add the mean forces between instants, before steps ``at`` (T,), to a recording.

        Things that sleep press on each other as they did in the step before.
        """
        packed = self.packed()
        if not packed:
            return recording
        offsets = np.cumsum([0, *(one.length for one in packed)])
        kinds = [np.concatenate(parts) for parts in list(zip(*packed, strict=True))[2:]]
        pairs, forces, asleep, _, others, points, pushes = kinds
        steps, touching = (
            np.concatenate(
                [
                    one[number] + offset
                    for one, offset in zip(packed, offsets, strict=False)
                ]
            )
            for number in (
                Measured._fields.index("steps"),
                Measured._fields.index("touching"),
            )
        )
        interval = np.searchsorted(
            at, np.arange(offsets[-1]), side="right"
        )  # of each step
        spans = np.diff(at, prepend=at[0] - 1)
        codes = pairs @ (len(self._names), 1)
        found = {}
        order = np.argsort(codes, kind="stable")
        for mine in (
            np.split(order, np.flatnonzero(np.diff(codes[order])) + 1)
            if len(order)
            else ()
        ):
            one, other = pairs[mine[0]]
            which = steps[mine]
            entries = forces[mine]
            resting = asleep[:, one] & asleep[:, other]
            if resting.any():
                since = np.maximum.accumulate(
                    np.where(resting, 0, np.arange(len(resting)))
                )
                begin = np.searchsorted(which, since)
                end = np.searchsorted(which, since, side="right")
                which = np.repeat(np.arange(len(resting)), end - begin)
                shift = np.repeat(
                    begin - np.cumsum(end - begin) + (end - begin), end - begin
                )
                entries = entries[np.arange(len(which)) + shift]
            sums = np.bincount(interval[which], entries, minlength=len(at))
            if sums.any():
                found[self._names[one], self._names[other]] = sums / spans
        samples = interval[touching]
        bodies = np.array(self._names, dtype=np.str_)[others]
        return replace(
            recording,
            forces=found,
            pushes=Pushes(samples, bodies, points, pushes / spans[samples, None]),
        )

"""Measure the normal forces between things in a world that is stepped."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import compress
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from core.geometry import Array
from core.interfaces import Pushes
from core.scene import Scene
from plugins.simulators.mujoco.contacts import Role
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.shapes import Element

Numbers = npt.NDArray[np.int64]

PACKED = 256  # steps whose contacts are packed at once
# As a number: an array is compared with an enum one by one.
_AWAKE = int(mujoco.mjtSleepState.mjS_AWAKE)
_OFF = int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
_NET = 3  # a sensor's way to make one of many contacts: the sum of the forces
_SENSED = 1 << int(mujoco.mjtConDataField.mjCONDATA_FORCE) | 1 << int(
    mujoco.mjtConDataField.mjCONDATA_POS
)
# Of all contacts, and of those of the links with one another.
_OUTER = "pushes"
_INNER = "pushes within"


def add_feeler(spec: Element, link: str) -> None:
    """Add what a `Feeler` reads: sensors of the contacts of a link and of all that it moves. They are off at first."""
    body = mujoco.mjtObj.mjOBJ_XBODY

    for name in (_OUTER, _INNER):
        sensor = spec.add_sensor(
            name=name,
            type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=body,
            objname=link,
        )
        sensor.intprm[:3] = (_SENSED, _NET, 1)

        if name == _INNER:
            sensor.reftype = body
            sensor.refname = link

    spec.option.disableflags |= _OFF


class Feeler:
    """What pushes the robot beyond its last joint, see `core.interfaces.World.pushes`."""

    def __init__(self, model: Element) -> None:
        self._model = model
        self._outer = int(model.sensor(_OUTER).adr[0])
        self._inner = int(model.sensor(_INNER).adr[0])

    @contextmanager
    def on(self) -> Iterator[None]:
        """Let the sensors measure."""
        self._model.opt.disableflags ^= _OFF
        try:
            yield
        finally:
            self._model.opt.disableflags ^= _OFF

    def pushes(self, sensed: Array) -> tuple[Array, Array]:
        """Return points (S, 3) and forces (S, 3), whose sum is the mean force in S steps.

        Contacts of stiff bodies chatter, so that one step alone may have none. What the links press on each other with
        is taken off: a tool's joint is within.

        Args:
            sensed: the sensors' data after each of the steps (S, X).
        """
        outer = sensed[:, self._outer :]
        inner = sensed[:, self._inner :]
        points = outer[:, 3:6]
        forces = (inner[:, :3] - outer[:, :3]) / len(sensed)
        return points, forces


class Measured(NamedTuple):
    """The contacts of S steps in a row: C of the scene's bodies, and P of these with the tool.

    Attributes:
        steps: the step of each contact (C,).
        pairs: the numbers of its two things, the smaller first (C, 2).
        forces: its normal force (C,).
        asleep: which things slept in each step (S, N).
        touching: the step of each contact with the tool (P,).
        others: the other thing (P,).
        points: where it is (P, 3).
        pushes: the force on the tool (P, 3).
    """

    steps: Numbers
    pairs: Numbers
    forces: Array
    asleep: npt.NDArray[np.bool_]
    touching: Numbers
    others: Numbers
    points: Array
    pushes: Array

    @property
    def length(self) -> int:
        """How many steps they are of."""
        return len(self.asleep)


class _Step(NamedTuple):
    """What the engine says after a step, of C contacts, R rows of the solver and B bodies.

    Attributes:
        geoms: the two geoms of each contact (C, 2); a flex is -1 minus its number.
        addresses: the first row of each contact (C,); -1: it presses with nothing.
        dims: the rows of each contact (C,).
        frames: its axes, the normal first (C, 9).
        points: where it is (C, 3).
        rows: the force of each row (R,).
        awake: whether each body is (B,).
    """

    geoms: Numbers
    addresses: Numbers
    dims: Numbers
    frames: Array
    points: Array
    rows: Array
    awake: Numbers


class Meter:
    """Measure what things press on each other with: the tool and the arm's links first, then the scene's bodies.

    A step only copies what the engine says; `pack` has the contacts of many steps, and makes sense of them at once.
    `measure` goes after each step, and `mean_forces` to the end of the motion.

    Args:
        scene: has the bodies.
        model: whose geoms say in their names what they are part of.
    """

    def __init__(self, scene: Scene, model: Element) -> None:
        robot = model.geom_contype != Role.SCENE.value[0]
        names = [model.geom(number).name for number in range(model.ngeom)]
        owners = [name.partition("/")[2] for name in names]
        links = sorted({*compress(owners, robot)})
        bodies = [body.name for body in scene.bodies]
        self._names = [*links, *bodies]
        self._links = len(links)
        self._tool = links.index("tool") if "tool" in links else -1

        # Names of links and bodies may be the same.
        ranks = {name: self._links + rank for rank, name in enumerate(bodies)}
        numbers = []
        for owner, is_robot in zip(owners, robot, strict=True):
            numbers.append(links.index(owner) if is_robot else ranks[owner])

        softs = [ranks[soft.name] for soft in scene.softs]
        self._owners = np.array(numbers)  # of geoms
        self._flexes = np.array(softs, dtype=np.int64)  # the owners of flexes

        # The model's bodies, of those in the scene.
        self._bodies = np.full(len(self._names), -1)
        self._bodies[self._owners[~robot]] = model.geom_bodyid[~robot]

        for number, owner in enumerate(softs):
            first = model.flex_vertadr[number]
            end = first + model.flex_vertnum[number]
            bearers = model.flex_vertbodyid[first:end]
            self._bodies[owner] = bearers[bearers > 0][0]

        self._packed: list[Measured] = []
        self._steps: list[_Step] = []  # not packed yet

    def measure(self, data: Element) -> None:
        """Copy the contacts of the last step."""
        contact = data.contact
        geoms = contact.geom.copy()
        if len(self._flexes):
            geoms = np.where(geoms < 0, -1 - contact.flex, geoms)

        step = _Step(
            geoms,
            contact.efc_address.copy(),
            contact.dim.copy(),
            contact.frame.copy(),
            contact.pos.copy(),
            data.efc_force.copy(),
            data.body_awake.copy(),
        )
        self._steps.append(step)
        if len(self._steps) == PACKED:
            self.pack()

    def save(self) -> tuple[list[Measured], list[_Step]]:
        """Return what was measured so far."""
        return list(self._packed), list(self._steps)

    def restore(self, saved: tuple[list[Measured], list[_Step]]) -> None:
        """Go on from what was measured so far by another one of the same scene."""
        packed, steps = saved
        self._packed = list(packed)
        self._steps = list(steps)

    def pack(self) -> list[Measured]:
        """Return the contacts of all steps so far."""
        if self._steps:
            self._packed.append(self._pack_steps())
            self._steps = []

        return self._packed

    def _pack_steps(self) -> Measured:
        """Make sense of the contacts of all steps that were only copied so far.

        Of two things that both sleep nothing is counted: `_repeat_resting` fills it in.
        """
        joined = _Step(*map(np.concatenate, zip(*self._steps, strict=True)))
        counts = np.array([len(step.geoms) for step in self._steps])
        rows = np.array([len(step.rows) for step in self._steps])
        steps = np.repeat(np.arange(len(counts)), counts)
        # Of an elliptic cone, a contact's first row is the normal.
        first = joined.addresses + np.repeat(np.cumsum(rows) - rows, counts)

        # A flex has -1 minus its number.
        owners = np.append(self._owners, self._flexes[::-1])[joined.geoms]
        pairs = np.sort(owners, axis=1)

        asleep = joined.awake.reshape(len(counts), -1)[:, self._bodies] != _AWAKE
        asleep[:, self._bodies < 0] = False
        resting = asleep[steps, pairs[:, 0]] & asleep[steps, pairs[:, 1]]
        counted = (joined.addresses >= 0) & (pairs[:, 1] >= self._links)
        new = np.flatnonzero(counted & ~resting)
        chosen = np.flatnonzero(counted & (pairs[:, 0] == self._tool))

        # The tool's contacts have up to three rows; without friction there is one.
        axes = np.arange(3)
        dims = joined.dims[chosen, None]
        along = joined.rows[first[chosen, None] + np.minimum(axes, dims - 1)]
        along = along * (axes < dims)

        frames = joined.frames[chosen].reshape(-1, 3, 3)
        on_second = np.einsum("pi,pij->pj", along, frames)
        pushes = np.where(owners[chosen, 1:] == self._tool, on_second, -on_second)
        return Measured(
            steps=steps[new],
            pairs=pairs[new],
            forces=joined.rows[first[new]],
            asleep=asleep,
            touching=steps[chosen],
            others=pairs[chosen, 1],
            points=joined.points[chosen],
            pushes=pushes,
        )

    def mean_forces(
        self, samples: Numbers
    ) -> tuple[dict[tuple[str, str], Array], Pushes | None]:
        """Compute the mean forces between instants, see `core.interfaces.Recording`.

        Things that sleep press on each other as they did in the step before.

        Args:
            samples: how many steps are done at each of the instants (T,).
        """
        packed = self.pack()
        if not packed:
            return {}, None

        measured = _join(packed)
        # Of each step.
        interval = np.searchsorted(samples, np.arange(measured.length), side="right")
        spans = np.diff(samples, prepend=samples[0] - 1)

        found = {}
        for pair, steps, entries in _group(measured):
            sums = np.bincount(interval[steps], entries, minlength=len(samples))
            if sums.any():
                first, second = pair
                found[self._names[first], self._names[second]] = sums / spans

        touched = interval[measured.touching]
        bodies = np.array(self._names, dtype=np.str_)[measured.others]
        pushes = measured.pushes / spans[touched, None]
        return found, Pushes(touched, bodies, measured.points, pushes)


def _join(parts: Sequence[Measured]) -> Measured:
    """Put steps in a row that come one after another."""
    done = 0
    shifted = []
    for part in parts:
        steps = part.steps + done
        shifted.append(part._replace(steps=steps, touching=part.touching + done))
        done += part.length

    return Measured(*map(np.concatenate, zip(*shifted, strict=True)))


def _group(measured: Measured) -> Iterator[tuple[Numbers, Numbers, Array]]:
    """Take the contacts of each two things that touch together.

    Yields:
        the two things (2,), and the step (C,) and normal force (C,) of each of their contacts.
    """
    things = measured.asleep.shape[1]
    codes = measured.pairs @ (things, 1)
    order = np.argsort(codes, kind="stable")
    begins = np.flatnonzero(np.diff(codes[order])) + 1

    for chosen in np.split(order, begins):
        if not len(chosen):  # there are no contacts at all
            return

        pair = measured.pairs[chosen[0]]
        first, second = pair
        steps = measured.steps[chosen]
        entries = measured.forces[chosen]
        resting = measured.asleep[:, first] & measured.asleep[:, second]
        if resting.any():
            steps, entries = _repeat_resting(steps, entries, resting)

        yield pair, steps, entries


def _repeat_resting(
    steps: Numbers, entries: Array, resting: npt.NDArray[np.bool_]
) -> tuple[Numbers, Array]:
    """Give each step in which two things rest the contacts of the last one in which they did not.

    Args:
        steps: of each of their contacts (C,), in order.
        entries: the normal force of each (C,).
        resting: whether both rest in each step (S,).

    Returns:
        steps and normal forces, as given, with those that are repeated.
    """
    numbers = np.arange(len(resting))
    # The step before each, in which they did not rest.
    since = np.maximum.accumulate(np.where(resting, 0, numbers))
    begin = np.searchsorted(steps, since)
    counts = np.searchsorted(steps, since, side="right") - begin

    shift = np.repeat(begin - np.cumsum(counts) + counts, counts)
    places = np.arange(len(shift)) + shift
    return np.repeat(numbers, counts), entries[places]

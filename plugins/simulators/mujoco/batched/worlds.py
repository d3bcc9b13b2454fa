"""Step a batch of worlds on the device together."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from core import interfaces
from core.design import MAX_JOINTS
from core.geometry import Array
from core.interfaces import Block, JointTrajectory, Passed
from core.scene import State
from plugins.simulators.mujoco.arm import HELD
from plugins.simulators.mujoco.batched.engine import mujoco_warp, warp
from plugins.simulators.mujoco.batched.kernels import (
    advance,
    cut,
    drive,
    leave_out,
    mend,
    note,
)
from plugins.simulators.mujoco.batched.models import PER_WORLD, ModelFigures, Size
from plugins.simulators.mujoco.contacts import is_discrete
from plugins.simulators.mujoco.shapes import Element

T = TypeVar("T")

_NO_ROOM = (
    mujoco_warp.OverflowType.ALL
    # Neither is a lack of capacity, and MuJoCo ignores both too.
    & ~(mujoco_warp.OverflowType.ITERATIONS | mujoco_warp.OverflowType.LS_ITERATIONS)
)


class Worlds(interfaces.Worlds):
    """Worlds with the same `ModelFigures.shared`; `begin` comes before each play.

    All steps are the same few hundred launches. They are recorded once, as a CUDA graph or its CPU equivalent.

    Args:
        compiled: the model, of one of the worlds.
        size: their capacity.
        device: Warp's.

    Attributes:
        crowded: which worlds had more contacts than there is room for, since they began.
    """

    def __init__(self, compiled: Element, size: Size, device: Any) -> None:
        self.size = size
        self.time_step = float(compiled.opt.timestep)
        self.crowded: list[bool] = []
        self._device = device
        self._figures: list[ModelFigures] = []
        self._trajectories: list[JointTrajectory] = []
        joints = compiled.nactuator
        numbers = compiled.nq + compiled.nv
        count = size.worlds

        self._ahead = int(is_discrete(compiled.opt))
        with warp.ScopedDevice(device):
            self._model = mujoco_warp.put_model(
                compiled, batch_sizes=dict.fromkeys(PER_WORLD, count)
            )
            # Otherwise it is printed; `crowded` says it.
            self._model.opt.warn_overflow = 0
            self._model.opt.deterministic = True
            rows = _count_rows(compiled, size.contacts)
            self._data = mujoco_warp.make_data(
                compiled, count, nconmax=size.contacts, njmax=rows
            )

            self._step, self._begin, self._last, self._noted, self._instants = (
                warp.zeros(count, dtype=int) for _ in range(5)
            )
            self._marks = warp.zeros((count, size.frames + 1), dtype=int)
            self._times = warp.zeros((count, size.instants), dtype=warp.float64)
            self._targets = warp.zeros(
                (count, size.instants, joints), dtype=warp.float64
            )
            self._stiffness, self._damping, self._aim = (
                warp.zeros((count, joints), dtype=warp.float64) for _ in range(3)
            )

            self._first = warp.zeros((count, compiled.nq), dtype=float)
            self._film = warp.zeros((size.frames, count, numbers), dtype=float)
            self._lost, self._astray, self._broken, self._crowded, self._counts = (
                warp.zeros(count, dtype=int) for _ in range(5)
            )
            # Otherwise rows beyond the capacity would be written past its end.
            self._model.callback.contactfilter = self._leave_out
            self._graph: Any = None

    def begin(
        self, figures: Sequence[ModelFigures], trajectories: Sequence[JointTrajectory]
    ) -> None:
        """Reset all worlds, each with the robot at a motion's first targets, and the tools' joints held.

        Worlds left over repeat the last job.

        Args:
            figures: of each job's model, at most `Size.worlds`.
            trajectories: of the jobs, which fit the size.
        """
        self._figures = [*figures]
        self._load_targets(trajectories)
        with warp.ScopedDevice(self._device):
            self._reset()
            if self._graph is None:
                self._step_once()  # compiles missing kernels
                with warp.ScopedCapture() as capture:
                    self._step_once()

                self._graph = capture.graph
                self._reset()

    def launch(self) -> None:
        """Give joints their springs and dry friction."""
        for name in ("jnt_stiffness", "dof_frictionloss"):
            _assign(getattr(self._model, name), self._stack(name))

    def advance(self, blocks: Sequence[Block]) -> list[Passed]:
        self._load_targets([block.trajectory for block in blocks])
        frames = max(len(block.marks) for block in blocks)
        with warp.ScopedDevice(self._device):
            self._load(blocks)
            for _ in range(max(len(block) for block in blocks)):
                warp.capture_launch(self._graph)

            self._note()
            film = self._film[: max(1, frames)].numpy()
            if self._device.is_cpu:  # where it is the same memory
                film = film.copy()

            lost = self._lost.numpy()
            broken = self._broken.numpy()

        count = len(blocks)
        self.crowded = [bool(lost[number] & _NO_ROOM) for number in range(count)]
        found = []
        for number, block in enumerate(blocks):
            error = None
            if broken[number]:
                error = "MuJoCo Warp: the simulation blew up: a state is not finite, or huge"
            if self.crowded[number]:
                error = f"MuJoCo Warp: more than {self.size.contacts} contacts at once"

            notes = [film[frame, number] for frame in range(len(block.marks))]
            found.append(Passed(notes, error=error))

        return found

    def note(self) -> list[Array]:
        numbers = np.concatenate(
            [self._data.qpos.numpy(), self._data.qvel.numpy()], axis=1
        )
        return [*numbers[: len(self._figures)]]

    def read(self, number: int, notes: Sequence[Array]) -> tuple[Array, Array, State]:
        figures = self._figures[number]
        numbers = np.array(notes, dtype=np.float64)
        return *figures.joints.read(numbers), figures.state(numbers)

    def _pad(self, jobs: Sequence[T]) -> list[T]:
        """Repeat the last job's for the worlds left over."""
        return [*jobs, *[jobs[-1]] * (self.size.worlds - len(jobs))]

    def _stack(self, name: str) -> Array:
        """Stack a field of all worlds' models (W, ...)."""
        return np.stack([world.fields[name] for world in self._pad(self._figures)])

    def _load_targets(self, trajectories: Sequence[JointTrajectory]) -> None:
        """Load the motions, where they are others than before."""
        known = self._trajectories
        if len(known) == len(trajectories) and all(
            map(operator.is_, known, trajectories)
        ):
            return

        self._trajectories = [*trajectories]
        times = np.zeros(self._times.shape)
        targets = np.zeros(self._targets.shape)
        instants = []

        for i, trajectory in enumerate(self._pad(trajectories)):
            known_times = len(trajectory.times)
            arm = trajectory.arm.shape[1]
            times[i, :known_times] = trajectory.times
            targets[i, :known_times, :arm] = trajectory.arm
            targets[i, :known_times, arm:] = trajectory.fingers[:, None]
            instants.append(known_times)

        _assign(self._instants, np.array(instants))
        _assign(self._times, times)
        _assign(self._targets, targets)

    def _reset(self) -> None:
        """Reset all worlds, and hold the tools' joints until `launch`."""
        figures = self._pad(self._figures)
        fields = {name: self._stack(name) for name in PER_WORLD}
        first = fields["qpos0"].copy()
        targets = self._targets.numpy()

        for i, world in enumerate(figures):
            fields["jnt_stiffness"][i, world.joints.loose] = 0.0
            fields["dof_frictionloss"][i, world.joints.loose] = HELD
            first[i, world.joints.driven] = targets[i, 0]

        for name, values in fields.items():
            _assign(getattr(self._model, name), values)

        mujoco_warp.reset_data(self._model, self._data)
        _assign(self._stiffness, np.stack([world.stiffness for world in figures]))
        _assign(self._damping, np.stack([world.damping for world in figures]))
        _assign(self._first, first)
        _assign(self._data.qpos, first)
        _assign(self._data.geom_xpos, np.stack([world.geom_xpos for world in figures]))
        _assign(self._data.geom_xmat, np.stack([world.geom_xmat for world in figures]))

        for array in (
            self._step,
            self._noted,
            self._lost,
            self._astray,
            self._broken,
            self._crowded,
        ):
            array.zero_()

    def _load(self, blocks: Sequence[Block]) -> None:
        """Load when the blocks begin and end, and their marks."""
        marks = np.full(self._marks.shape, -1)
        for i, block in enumerate(blocks):
            marks[i, : len(block.marks)] = block.marks

        padded = self._pad(blocks)
        begins = [round(block.instants[0] / self.time_step) for block in padded]
        _assign(self._marks, marks)
        _assign(self._begin, np.array(begins))
        _assign(self._last, np.array([len(block) for block in padded]))
        self._step.zero_()
        self._noted.zero_()

    def _step_once(self) -> None:
        """Step all worlds once: note their states, mend those that diverged, drive, and step."""
        data = self._data
        self._note()
        mended = [self._astray, self._first, data.qpos, data.qvel, data.qacc_warmstart]
        warp.launch(mend, self.size.worlds, mended)

        driven = [
            self._step,
            self._begin,
            self._broken,
            self.time_step,
            self._ahead,
            self._instants,
            self._times,
            self._targets,
            self._stiffness,
            self._damping,
            self._aim,
            data.ctrl,
        ]
        warp.launch(drive, self._aim.shape, driven)
        mujoco_warp.step(self._model, data)
        warp.launch(advance, self.size.worlds, [self._step, self._marks, self._noted])

    def _leave_out(self, _: Any, data: Any) -> None:
        """Drop contacts beyond a world's room, and note that it was crowded.

        MuJoCo Warp calls it after it has found the contacts, with its model and data.
        """
        contact = data.contact
        self._counts.zero_()
        counted = [
            self.size.contacts,
            data.nacon,
            contact.worldid,
            contact.type,
            self._counts,
            self._crowded,
        ]
        warp.launch(leave_out, max(data.naconmax, self.size.worlds), counted)
        warp.launch(cut, 1, [data.naconmax, data.nacon])

    def _note(self) -> None:
        """Record the state before a step, where there is a mark.

        It is also called after the last step, whose end is a state, too.
        """
        data = self._data
        noted = [
            self._step,
            self._last,
            self._marks,
            self._noted,
            data.qpos,
            data.qvel,
            data.overflow,
            self._crowded,
            self._film,
            self._lost,
            self._astray,
            self._broken,
        ]
        warp.launch(note, (self.size.worlds, self._film.shape[2]), noted)


def _count_rows(compiled: Element, contacts: int) -> int:
    """Count the constraint rows of a world at most.

    Args:
        compiled: the model.
        contacts: how many there may be.
    """
    dims = [int(compiled.geom_condim.max()), *(int(dim) for dim in compiled.pair_dim)]
    loose = int(np.count_nonzero(compiled.dof_frictionloss)) + MAX_JOINTS
    limited = int(compiled.jnt_limited.sum())
    return contacts * max(dims) + limited + int(compiled.neq) + loose


def _assign(array: Any, values: Array) -> None:
    """Copy numbers to the device, as an array's own type: of a vector, its components'."""
    scalar = getattr(array.dtype, "_wp_scalar_type_", array.dtype)
    array.assign(np.ascontiguousarray(values, dtype=warp.dtype_to_numpy(scalar)))

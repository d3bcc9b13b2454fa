"""Step a batch of worlds on the device together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from core.design import MAX_JOINTS
from core.geometry import Array
from core.simulation.playback import LAG_EVERY, Schedule
from plugins.simulators.mujoco.batched.engine import mujoco_warp, warp
from plugins.simulators.mujoco.batched.kernels import (
    advance,
    cut,
    drive,
    leave_out,
    mend,
    note,
    release,
)
from plugins.simulators.mujoco.batched.models import (
    PER_WORLD,
    ModelFigures,
    Played,
    Size,
)
from plugins.simulators.mujoco.contacts import is_discrete
from plugins.simulators.mujoco.joints import HELD
from plugins.simulators.mujoco.shapes import Element

_NO_ROOM = (
    mujoco_warp.OverflowType.ALL
    # Neither is a lack of capacity, and MuJoCo ignores both too.
    & ~(mujoco_warp.OverflowType.ITERATIONS | mujoco_warp.OverflowType.LS_ITERATIONS)
)


class Worlds:
    """Worlds with the same `ModelFigures.shared`.

    All steps of a rollout are the same few hundred launches. They are recorded once, as a CUDA graph or its CPU
    equivalent.

    Args:
        compiled: the model, of one of the worlds.
        size: their capacity.
        device: Warp's.
    """

    def __init__(self, compiled: Element, size: Size, device: Any) -> None:
        self.size = size
        self._arm = 0
        self._device = device
        self._dt = float(compiled.opt.timestep)
        joints = compiled.nactuator
        numbers = compiled.nq + compiled.nv
        count = size.worlds

        self._ahead = int(is_discrete(compiled.opt))
        with warp.ScopedDevice(device):
            self._model = mujoco_warp.put_model(
                compiled, batch_sizes=dict.fromkeys(PER_WORLD, count)
            )
            # Otherwise it is printed; `Played.crowded` says it.
            self._model.opt.warn_overflow = 0
            self._model.opt.deterministic = True
            rows = _count_rows(compiled, size.contacts)
            self._data = mujoco_warp.make_data(
                compiled, count, nconmax=size.contacts, njmax=rows
            )

            self._step = warp.zeros(1, dtype=int)
            self._settle, self._last, self._every, self._instants = (
                warp.zeros(count, dtype=int) for _ in range(4)
            )
            self._times = warp.zeros((count, size.instants), dtype=warp.float64)
            self._targets = warp.zeros(
                (count, size.instants, joints), dtype=warp.float64
            )
            self._stiffness, self._damping, self._aim = (
                warp.zeros((count, joints), dtype=warp.float64) for _ in range(3)
            )

            self._first = warp.zeros((count, compiled.nq), dtype=float)
            self._start, self._end = (
                warp.zeros((count, numbers), dtype=float) for _ in range(2)
            )
            self._film = warp.zeros((size.frames, count, numbers), dtype=float)
            self._springs = warp.zeros((count, compiled.njnt), dtype=float)
            self._frictions = warp.zeros((count, compiled.nv), dtype=float)

            self._lag = warp.zeros(count, dtype=warp.float64)
            self._lost, self._astray, self._broken, self._crowded, self._counts = (
                warp.zeros(count, dtype=int) for _ in range(5)
            )
            # Otherwise rows beyond the capacity would be written past its end.
            self._model.callback.contactfilter = self._leave_out
            self._graph: Any = None

    def play(
        self, figures: Sequence[ModelFigures], schedules: Sequence[Schedule]
    ) -> list[Played]:
        """Play one job in each world.

        Args:
            figures: of each job's model.
            schedules: of the jobs, at most `Size.worlds`, with trajectories and recordings that fit the size.
        """
        with warp.ScopedDevice(self._device):
            last = self._load(figures, schedules)
            if self._graph is None:
                self._step_once()  # compiles missing kernels
                with warp.ScopedCapture() as capture:
                    self._step_once()

                self._graph = capture.graph
                self._load(figures, schedules)

            for _ in range(max(last)):
                warp.capture_launch(self._graph)

            self._note()
            start = self._start.numpy()
            end = self._end.numpy()
            film = self._film.numpy()
            lag = self._lag.numpy()
            lost = self._lost.numpy()
            broken = self._broken.numpy()
            every = self._every.numpy()

        results = []
        for i in range(len(schedules)):
            frames = 0
            if every[i]:
                frames = -(-last[i] // every[i])

            crowded = bool(lost[i] & _NO_ROOM)
            results.append(
                Played(
                    start[i],
                    end[i],
                    film[:frames, i],
                    float(lag[i]),
                    broken=bool(broken[i]),
                    crowded=crowded,
                )
            )

        return results

    def _load(
        self, figures: Sequence[ModelFigures], schedules: Sequence[Schedule]
    ) -> list[int]:
        """Reset all worlds, and load the jobs. Worlds left over repeat the last job.

        Args:
            figures: of each job's model.
            schedules: of the jobs.

        Returns:
            how many steps each world has.
        """
        count = self.size.worlds
        self._arm = schedules[0].job.trajectory.arm.shape[1]
        which = np.minimum(np.arange(count), len(schedules) - 1)
        figures = [figures[i] for i in which]
        schedules = [schedules[i] for i in which]

        fields = {}
        for name in PER_WORLD:
            fields[name] = np.stack([world.fields[name] for world in figures])

        _assign(self._springs, fields["jnt_stiffness"])
        _assign(self._frictions, fields["dof_frictionloss"])

        for i, world in enumerate(figures):  # held until the motion begins
            fields["jnt_stiffness"][i, world.joints.loose] = 0.0
            fields["dof_frictionloss"][i, world.joints.loose] = HELD

        for name, values in fields.items():
            _assign(getattr(self._model, name), values)

        mujoco_warp.reset_data(self._model, self._data)

        first = np.stack([world.fields["qpos0"] for world in figures])
        times = np.zeros(self._times.shape)
        targets = np.zeros(self._targets.shape)
        instants = []
        for i, schedule in enumerate(schedules):
            trajectory = schedule.job.trajectory
            known = len(trajectory.times)
            times[i, :known] = trajectory.times
            targets[i, :known, : self._arm] = trajectory.arm
            targets[i, :known, self._arm :] = trajectory.fingers[:, None]
            first[i, figures[i].joints.driven] = targets[i, 0]
            instants.append(known)

        last = [len(schedule.times) for schedule in schedules]

        _assign(self._settle, np.array([schedule.settle for schedule in schedules]))
        _assign(self._last, np.array(last))
        _assign(self._every, np.array([schedule.every for schedule in schedules]))
        _assign(self._instants, np.array(instants))
        _assign(self._times, times)
        _assign(self._targets, targets)
        _assign(self._stiffness, np.stack([world.stiffness for world in figures]))
        _assign(self._damping, np.stack([world.damping for world in figures]))
        _assign(self._first, first)
        _assign(self._data.qpos, first)
        _assign(self._data.geom_xpos, np.stack([world.geom_xpos for world in figures]))
        _assign(self._data.geom_xmat, np.stack([world.geom_xmat for world in figures]))

        for array in (
            self._step,
            self._lag,
            self._lost,
            self._astray,
            self._broken,
            self._crowded,
        ):
            array.zero_()

        return last

    def _step_once(self) -> None:
        """Step all worlds once: note their states, release joints, mend those that diverged, drive, and step."""
        data = self._data
        self._note()
        released = [
            self._step,
            self._settle,
            self._springs,
            self._frictions,
            self._model.jnt_stiffness,
            self._model.dof_frictionloss,
        ]
        warp.launch(release, self._frictions.shape, released)

        mended = [self._astray, self._first, data.qpos, data.qvel, data.qacc_warmstart]
        warp.launch(mend, self.size.worlds, mended)

        driven = [
            self._step,
            self._settle,
            self._broken,
            self._dt,
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
        warp.launch(advance, 1, [self._step])

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
        """Record the state before a step, where one is asked for.

        It is also called after the last step, whose end is a state, too.
        """
        data = self._data
        noted = [
            self._step,
            self._settle,
            self._last,
            self._every,
            LAG_EVERY,
            self._arm,
            data.qpos,
            data.qvel,
            self._aim,
            data.overflow,
            self._crowded,
            self._start,
            self._end,
            self._film,
            self._lag,
            self._lost,
            self._astray,
            self._broken,
        ]
        warp.launch(note, self._start.shape, noted)


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

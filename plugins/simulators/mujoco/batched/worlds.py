"""A number of worlds on the device, stepped together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from core.geometry import Array
from core.interfaces import Rollout
from core.robot.description import ARM_JOINTS
from core.simulation.playback import LAG_EVERY, record_every, schedule
from plugins.simulators.mujoco.batched.engine import mujoco_warp, warp
from plugins.simulators.mujoco.batched.kernels import advance, cut, drive, leave_out, mend, note
from plugins.simulators.mujoco.batched.models import PER_WORLD, Figures, Played, Size
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.shapes import Element

_ARM = len(ARM_JOINTS)
_NO_ROOM = (
    mujoco_warp.OverflowType.ALL
    # Neither is a lack of room, and MuJoCo goes on without a word too.
    & ~(mujoco_warp.OverflowType.ITERATIONS | mujoco_warp.OverflowType.LS_ITERATIONS)
)


class Worlds:
    """Worlds that share what `Figures.shared` says. All steps of a rollout are the same few hundred launches, which are
    recorded once: a CUDA graph, or its like for the processor.
    """

    def __init__(self, made: Element, size: Size, device: Any) -> None:
        self.size = size
        self._device, self._dt = device, float(made.opt.timestep)
        joints, numbers, count = made.nactuator, made.nq + made.nv, size.worlds
        self._ahead = int(made.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE)
        with warp.ScopedDevice(device):
            self._model = mujoco_warp.put_model(made, batch_sizes=dict.fromkeys(PER_WORLD, count))
            self._model.opt.warn_overflow = 0  # it would be printed; `Played.lost` tells
            self._model.opt.deterministic = True
            self._data = mujoco_warp.make_data(made, count, nconmax=size.contacts, njmax=_rows(made, size.contacts))
            self._step = warp.zeros(1, dtype=int)
            self._settle, self._last, self._every, self._instants = (warp.zeros(count, dtype=int) for _ in range(4))
            self._times = warp.zeros((count, size.instants), dtype=warp.float64)
            self._targets = warp.zeros((count, size.instants, joints), dtype=warp.float64)
            self._stiffness, self._damping, self._aim = (
                warp.zeros((count, joints), dtype=warp.float64) for _ in range(3)
            )
            self._first = warp.zeros((count, made.nq), dtype=float)
            self._start, self._end = (warp.zeros((count, numbers), dtype=float) for _ in range(2))
            self._film = warp.zeros((size.frames, count, numbers), dtype=float)
            self._lag = warp.zeros(count, dtype=warp.float64)
            self._lost, self._astray, self._broken, self._crowded, self._felt = (
                warp.zeros(count, dtype=int) for _ in range(5)
            )
            # More rows than there is room for would be written beyond it.
            self._model.callback.contactfilter = self._leave_out
            self._graph: Any = None

    def nbytes(self) -> int:
        """Of what lies on the device between steps."""
        return sum(array.capacity for array in _arrays(vars(self)))

    def play(self, figures: Sequence[Figures], jobs: Sequence[Rollout]) -> list[Played]:
        """One job in each world; at most `Size.worlds` of them, whose trajectories and films fit the size."""
        with warp.ScopedDevice(self._device):
            last = self._load(figures, jobs)
            if self._graph is None:
                self._one()  # which compiles what is not compiled yet
                with warp.ScopedCapture() as capture:
                    self._one()
                self._graph = capture.graph
                self._load(figures, jobs)
            for _ in range(max(last)):
                warp.capture_launch(self._graph)
            self._note()
            start, end, film = self._start.numpy(), self._end.numpy(), self._film.numpy()
            lag, lost, broken = self._lag.numpy(), self._lost.numpy(), self._broken.numpy()
        every = self._every.numpy()
        return [
            Played(
                start[i],
                end[i],
                film[: -(-last[i] // every[i]) if every[i] else 0, i],
                float(lag[i]),
                bool(broken[i]),
                bool(lost[i] & _NO_ROOM),
            )
            for i in range(len(jobs))
        ]

    def _load(self, figures: Sequence[Figures], jobs: Sequence[Rollout]) -> list[int]:
        """Put all worlds to their start; gives how many steps each takes. Those that are left over do as the last."""
        count = self.size.worlds
        which = np.minimum(np.arange(count), len(jobs) - 1)
        mine, theirs = [figures[i] for i in which], [jobs[i] for i in which]
        for name in PER_WORLD:
            _assign(getattr(self._model, name), np.stack([one.fields[name] for one in mine]))
        mujoco_warp.reset_data(self._model, self._data)
        first = np.stack([one.fields["qpos0"] for one in mine])
        times, targets = np.zeros(self._times.shape), np.zeros(self._targets.shape)
        schedules, instants = [], []
        for i, job in enumerate(theirs):
            trajectory, known = job.trajectory, len(job.trajectory.times)
            times[i, :known], targets[i, :known, :_ARM] = trajectory.times, trajectory.arm
            targets[i, :known, _ARM:] = trajectory.fingers[:, None]
            first[i, : targets.shape[2]] = targets[i, 0]
            settle, begins = schedule(job, self._dt)
            schedules.append((settle, len(begins), record_every(job, self._dt)))
            instants.append(known)
        settle, last, every = np.array(schedules).T
        _assign(self._settle, settle)
        _assign(self._last, last)
        _assign(self._every, every)
        _assign(self._instants, np.array(instants))
        _assign(self._times, times)
        _assign(self._targets, targets)
        _assign(self._stiffness, np.stack([one.stiffness for one in mine]))
        _assign(self._damping, np.stack([one.damping for one in mine]))
        _assign(self._first, first)
        _assign(self._data.qpos, first)
        _assign(self._data.geom_xpos, np.stack([one.geom_xpos for one in mine]))
        _assign(self._data.geom_xmat, np.stack([one.geom_xmat for one in mine]))
        for array in (self._step, self._lag, self._lost, self._astray, self._broken, self._crowded):
            array.zero_()
        return [int(steps) for steps in last]

    def _one(self) -> None:
        """A step of all worlds."""
        data = self._data
        self._note()
        warp.launch(mend, self.size.worlds, [self._astray, self._first, data.qpos, data.qvel, data.qacc_warmstart])
        warp.launch(
            drive,
            self._aim.shape,
            [
                *(self._step, self._settle, self._broken, self._dt, self._ahead, self._instants),
                *(self._times, self._targets, self._stiffness, self._damping, self._aim, data.ctrl),
            ],
        )
        mujoco_warp.step(self._model, data)
        warp.launch(advance, 1, [self._step])

    def _leave_out(self, _: Any, data: Any) -> None:
        contact, most = data.contact, self.size.contacts
        self._felt.zero_()
        warp.launch(
            leave_out,
            max(data.naconmax, self.size.worlds),
            [most, data.nacon, contact.worldid, contact.type, self._felt, self._crowded],
        )
        warp.launch(cut, 1, [data.naconmax, data.nacon])

    def _note(self) -> None:
        data = self._data
        warp.launch(
            note,
            self._start.shape,
            [
                *(self._step, self._settle, self._last, self._every, LAG_EVERY, _ARM, data.qpos, data.qvel, self._aim),
                *(data.overflow, self._crowded, self._start, self._end, self._film, self._lag),
                *(self._lost, self._astray, self._broken),
            ],
        )


def _rows(made: Element, contacts: int) -> int:
    """Of constraints, for so many contacts."""
    most = max([int(made.geom_condim.max()), *(int(dim) for dim in made.pair_dim)])
    return contacts * most + int(made.jnt_limited.sum()) + int(made.neq)


def _assign(array: Any, values: Array) -> None:
    scalar = getattr(array.dtype, "_wp_scalar_type_", array.dtype)  # of a vector, what it is made of
    array.assign(np.ascontiguousarray(values, dtype=warp.dtype_to_numpy(scalar)))


def _arrays(part: Any) -> Iterator[Any]:
    """Warp's arrays in a dictionary or a dataclass, and in those in it."""
    items = part.items() if isinstance(part, dict) else [(f.name, getattr(part, f.name)) for f in fields(part)]
    for _, value in items:
        if isinstance(value, warp.array):
            yield value
        elif is_dataclass(value) and not isinstance(value, type):
            yield from _arrays(value)

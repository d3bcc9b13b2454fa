"""Play rollouts in MuJoCo Warp: many worlds at once on a GPU, or for tests on the CPU."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from core.errors import UsageError, UserError
from core.interfaces import Outcome, Rollout, Task
from core.scene import Scene
from core.simulation.playback import Schedule
from plugins.simulators.mujoco.batched.models import (
    ModelFigures,
    Played,
    Size,
    figures,
    model,
)
from plugins.simulators.mujoco.joints import Joints
from plugins.simulators.mujoco.model import compute_inertias
from plugins.simulators.mujoco.shapes import Element
from plugins.simulators.mujoco.simulator import MuJoCoSimulator
from plugins.simulators.rendering import DrawingSimulator
from plugins.simulators.rigid import only_rigid

if TYPE_CHECKING:
    from plugins.simulators.mujoco.batched.worlds import Worlds

_KEPT_BATCHES = 8
_KEPT_FIGURES = 4096  # some kilobytes each
_MOST_CONTACTS = 8192  # in a world; beyond that something else is wrong


class MuJoCoWarpSimulator(DrawingSimulator):
    """Step worlds together that share the layout's bodies, the gripper or none, and roughly the tool's number of boxes.

    Args:
        device: ``cuda``, ``cuda:1`` and so on, or ``cpu``.
        worlds: the largest number at once; too many for the device's memory are tried in smaller batches.
        time_step: seconds.
        tracking_rate: how fast a joint converges to its target, 1/s.
        slip_rate: how fast friction stops slow slip, 1/s, as in `sim=mujoco`.
    """

    batch: ClassVar[int] = 2048
    renderer = MuJoCoSimulator.renderer

    def __init__(
        self,
        device: str = "cuda",
        worlds: int = 8192,
        time_step: float = 0.0025,
        tracking_rate: float = 50.0,
        slip_rate: float = 200.0,
    ) -> None:
        self._rates = time_step, tracking_rate, slip_rate
        MuJoCoSimulator(*self._rates)  # checks them
        if worlds < 1:
            raise UsageError(f"sim.worlds must be at least 1, got {worlds}")
        self.worlds = worlds
        from plugins.simulators.mujoco.batched import engine  # needs the extra packages
        from plugins.simulators.mujoco.batched import worlds as many

        self._device = engine.device(device)
        self._make = many.Worlds
        self._figures: OrderedDict[tuple[int, str], tuple[Scene, ModelFigures]] = (
            OrderedDict()
        )
        self._contacts: dict[str, int] = {}  # capacity, by digest
        self._batches: OrderedDict[tuple[str, Size], Worlds] = OrderedDict()

    def rollout(self, task: Task, jobs: Sequence[Rollout]) -> list[Outcome]:
        outcomes: dict[int, Outcome] = {}
        groups: dict[str, list[int]] = {}
        mine: dict[int, ModelFigures] = {}
        if any(job.forces for job in jobs):
            raise UserError(
                "sim=mujoco_warp can't measure the forces of contacts; use sim=mujoco"
            )
        for i, job in enumerate(jobs):
            mine[i] = self._of(task, job)
            groups.setdefault(mine[i].shared, []).append(i)
        for members in groups.values():
            # So that neighbours end together.
            members.sort(key=lambda i: len(self._schedule(jobs[i]).times))
            for i, played in self._played(task, members, mine, jobs):
                outcomes[i] = self._outcome(jobs[i], mine[i], played)
        return [outcomes[i] for i in range(len(jobs))]

    def _schedule(self, job: Rollout) -> Schedule:
        return Schedule(job, self._rates[0])

    def _of(self, task: Task, job: Rollout) -> ModelFigures:
        scene = job.scene_in(task)
        key = (
            id(scene),
            job.tool.content,
        )  # the entry keeps the scene, so that its id is its own
        if key not in self._figures:
            only_rigid(scene, task.name, "mujoco_warp")
            if scene.joints or any(body.launched for body in scene.free):
                raise UserError(
                    f"{task.name}: sim=mujoco_warp can't have joints or launched bodies in a scene; use sim=mujoco"
                )
            compiled = self._model(task, job)
            joints = Joints.find(task.robot, job.tool, compiled)
            self._figures[key] = scene, figures(compiled, scene, joints)
            if len(self._figures) > _KEPT_FIGURES:
                self._figures.popitem(last=False)
        self._figures.move_to_end(key)
        return self._figures[key][1]

    def _model(self, task: Task, job: Rollout) -> Element:
        scene = job.scene_in(task)
        return model(task.robot, scene, compute_inertias(scene), job.tool, *self._rates)

    def _played(
        self,
        task: Task,
        members: Sequence[int],
        mine: dict[int, ModelFigures],
        jobs: Sequence[Rollout],
    ) -> Iterator[tuple[int, Played]]:
        """Yield each job's number and result. Jobs with too many contacts are repeated with more capacity."""
        waiting = list(members)
        while waiting:
            worlds = self._batch(task, [jobs[i] for i in waiting], mine[waiting[0]])
            now = waiting[: worlds.size.worlds]
            waiting = waiting[worlds.size.worlds :]
            again = []
            for i, played in zip(
                now,
                worlds.play([mine[i] for i in now], [jobs[i] for i in now]),
                strict=True,
            ):
                if played.crowded and 2 * worlds.size.contacts <= _MOST_CONTACTS:
                    again.append(i)
                else:
                    yield i, played
            if again:
                self._contacts[mine[again[0]].shared] = 2 * worlds.size.contacts
                waiting = again + waiting

    def _batch(self, task: Task, jobs: Sequence[Rollout], of: ModelFigures) -> Worlds:
        """Make worlds for the first of the jobs. Sizes are rounded up to powers of two, so that few are made."""
        frames = [len(self._schedule(job).samples) for job in jobs]
        size = Size(
            min(_up(len(jobs)), self.worlds),
            _up(max(frames, default=1)),
            _up(max(len(job.trajectory.times) for job in jobs)),
            self._contacts.get(of.shared)
            or _up(32 + 4 * len(of.names) + len(of.geom_xpos)),
        )
        known = of.shared, size
        if known not in self._batches:
            self._batches[known] = self._make(
                self._model(task, jobs[0]), size, self._device
            )
            if len(self._batches) > _KEPT_BATCHES:
                self._batches.popitem(last=False)
        self._batches.move_to_end(known)
        return self._batches[known]

    def _outcome(self, job: Rollout, of: ModelFigures, played: Played) -> Outcome:
        if played.crowded:
            return Outcome(
                None,
                None,
                error=f"MuJoCo Warp: more than {_MOST_CONTACTS // 2} contacts at once",
            )
        if played.broken:
            return Outcome(
                None,
                None,
                error="MuJoCo Warp: the simulation blew up: a state is not finite, or huge",
            )
        start, end, film = (
            numbers.astype(np.float64)
            for numbers in (played.start, played.end, played.film)
        )
        schedule = self._schedule(job)
        seen = None
        if schedule.every:
            numbers = np.concatenate([film, end[None]])
            seen = (*of.joints.read(numbers), of.state(numbers))
        return schedule.conclude(of.state(start), of.state(end), played.lag, seen)


def _up(count: int) -> int:
    """Round up to a power of two."""
    return 1 << max(0, count - 1).bit_length()

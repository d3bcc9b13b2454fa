"""Play rollouts in MuJoCo Warp: many worlds at once on a GPU, or for tests on the CPU."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from core.errors import UsageError, UserError
from core.interfaces import Outcome, Rollout, Task
from core.scene import Scene
from core.simulation.playback import Schedule, refuse_targets
from plugins.simulators.mujoco.batched.models import (
    ModelFigures,
    Played,
    Size,
    extract_figures,
    model,
)
from plugins.simulators.mujoco.joints import Joints
from plugins.simulators.mujoco.keeping import keep
from plugins.simulators.mujoco.shapes import Element
from plugins.simulators.mujoco.simulator import MuJoCoSimulator
from plugins.simulators.rendering import DrawingSimulator
from plugins.simulators.rigid import only_rigid
from plugins.simulators.scenes import scene_of

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
        if any(job.forces for job in jobs):
            raise UserError(
                "sim=mujoco_warp can't measure the forces of contacts; use sim=mujoco"
            )

        schedules = [Schedule(job, self._rates[0]) for job in jobs]
        figures = [self._find_figures(task, job) for job in jobs]
        outcomes: dict[int, Outcome] = {}
        groups: dict[str, list[int]] = {}

        for number, known in enumerate(figures):
            refused = refuse_targets(jobs[number])
            if refused is None:
                groups.setdefault(known.shared, []).append(number)
            else:
                outcomes[number] = refused

        for members in groups.values():
            # So that neighbours end together.
            members.sort(key=lambda number: len(schedules[number].times))
            for number, played in self._play(task, members, figures, schedules):
                outcome = self._outcome(schedules[number], figures[number], played)
                outcomes[number] = outcome

        return [outcomes[number] for number in range(len(jobs))]

    def _find_figures(self, task: Task, job: Rollout) -> ModelFigures:
        """Return a world's own figures for a job's scene and tool; those of the last few thousand are kept.

        Args:
            task: says the robot.
            job: says the scene and the tool.

        Raises:
            UserError: the scene has what MuJoCo Warp can't play.
        """
        scene = scene_of(job, task)

        def extract() -> tuple[Scene, ModelFigures]:
            only_rigid(scene, task.name, "mujoco_warp")
            if scene.joints or any(body.launched for body in scene.free):
                raise UserError(
                    f"{task.name}: sim=mujoco_warp can't have joints or launched bodies in a scene; use sim=mujoco"
                )

            compiled = self._model(task, job)
            joints = Joints.find(task.robot, job.tool, compiled)

            return scene, extract_figures(compiled, scene, joints)

        # The entry keeps the scene, so that no other gets its id.
        key = (id(scene), job.tool.content)

        return keep(self._figures, key, _KEPT_FIGURES, extract)[1]

    def _model(self, task: Task, job: Rollout) -> Element:
        """Compile the model of a job's world."""
        return model(task.robot, scene_of(job, task), job.tool, *self._rates)

    def _play(
        self,
        task: Task,
        members: Sequence[int],
        figures: Sequence[ModelFigures],
        schedules: Sequence[Schedule],
    ) -> Iterator[tuple[int, Played]]:
        """Yield each member's number and result. Jobs with too many contacts are repeated with more capacity.

        Args:
            task: that of all jobs.
            members: the numbers of the jobs that can be in one batch.
            figures: of all jobs.
            schedules: of all jobs.
        """
        shared = figures[members[0]].shared
        waiting = list(members)

        while waiting:
            ahead = [schedules[number] for number in waiting]
            worlds = self._batch(task, ahead, figures[waiting[0]])
            now = waiting[: worlds.size.worlds]
            waiting = waiting[worlds.size.worlds :]
            results = worlds.play(
                [figures[number] for number in now], ahead[: len(now)]
            )
            again = []

            for number, played in zip(now, results, strict=True):
                if played.crowded and 2 * worlds.size.contacts <= _MOST_CONTACTS:
                    again.append(number)
                else:
                    yield number, played

            if again:
                self._contacts[shared] = 2 * worlds.size.contacts
                waiting = again + waiting

    def _batch(
        self, task: Task, schedules: Sequence[Schedule], figures: ModelFigures
    ) -> Worlds:
        """Return worlds for the first of the jobs.

        Sizes are rounded up to powers of two, so that few are made.

        Args:
            task: that of all jobs.
            schedules: of the jobs.
            figures: theirs, but for what is a world's own.
        """
        contacts = self._contacts.get(figures.shared)
        if contacts is None:
            contacts = _round_up(32 + 4 * len(figures.names) + len(figures.geom_xpos))

        frames = [len(schedule.samples) for schedule in schedules]
        instants = [len(schedule.job.trajectory.times) for schedule in schedules]
        size = Size(
            worlds=min(_round_up(len(schedules)), self.worlds),
            frames=_round_up(max(frames)),
            instants=_round_up(max(instants)),
            contacts=contacts,
        )

        def build() -> Worlds:
            return self._make(self._model(task, schedules[0].job), size, self._device)

        return keep(self._batches, (figures.shared, size), _KEPT_BATCHES, build)

    def _outcome(
        self, schedule: Schedule, figures: ModelFigures, played: Played
    ) -> Outcome:
        """Make a job's outcome of its world's result; an error if that can't be trusted."""
        if played.crowded:
            problem = f"more than {_MOST_CONTACTS // 2} contacts at once"
            return Outcome(None, None, error=f"MuJoCo Warp: {problem}")

        if played.broken:
            problem = "the simulation blew up: a state is not finite, or huge"
            return Outcome(None, None, error=f"MuJoCo Warp: {problem}")

        end = played.end.astype(np.float64)
        film = None

        if schedule.every:
            numbers = np.concatenate([played.film.astype(np.float64), end[None]])
            film = (*figures.joints.read(numbers), figures.state(numbers))

        start = figures.state(played.start.astype(np.float64))

        return schedule.conclude(start, figures.state(end), played.lag, film)


def _round_up(count: int) -> int:
    """Round up to a power of two."""
    return 1 << max(0, count - 1).bit_length()

"""Play rollouts in MuJoCo Warp: many worlds at once on a GPU, or for tests on the CPU."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from core.errors import UsageError
from core.hooks import Harmless
from core.interfaces import Ability, Outcome, Rollout, Task
from core.scene import Scene
from core.simulation.engines import check_support, refuse_hurried, scene_of
from core.simulation.playback import Schedule, play_together, refuse_targets
from plugins.simulators.mujoco.arm import Joints
from plugins.simulators.mujoco.batched.models import (
    ModelFigures,
    Size,
    extract_figures,
    model,
)
from plugins.simulators.mujoco.keeping import keep
from plugins.simulators.mujoco.shapes import Element
from plugins.simulators.mujoco.simulator import MuJoCoSimulator
from plugins.simulators.rendering import DrawingSimulator

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
    supports = frozenset({Ability.TOOL_JOINTS})
    renderer = MuJoCoSimulator.renderer

    def __init__(
        self,
        device: Harmless[str] = "cuda",
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
        groups: dict[tuple[str, int], list[int]] = {}
        schedules = [Schedule(job, self._rates[0]) for job in jobs]

        for number, job in enumerate(jobs):
            check_support(self, task.name, scene_of(job, task), job)
            refused = refuse_targets(job)
            if refused is not None:
                outcomes[number] = refused
                continue

            figures = self._find_figures(task, job)
            key = (figures.shared, schedules[number].settle)
            groups.setdefault(key, []).append(number)

        for members in groups.values():
            # So that neighbours end together.
            members.sort(key=lambda number: schedules[number].count)
            waiting = [_Waiting(number, schedules[number]) for number in members]
            outcomes.update(self._play(task, waiting))

        return [
            refuse_hurried(scene_of(job, task), outcomes[number])
            for number, job in enumerate(jobs)
        ]

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
            compiled = self._model(task, job)
            joints = Joints(task.robot, job.tool, compiled)

            return scene, extract_figures(compiled, scene, joints)

        # The entry keeps the scene, so that no other gets its id.
        key = (id(scene), job.tool.content)

        return keep(self._figures, key, _KEPT_FIGURES, extract)[1]

    def _model(self, task: Task, job: Rollout) -> Element:
        """Compile the model of a job's world."""
        return model(task.robot, scene_of(job, task), job.tool, *self._rates)

    def _play(
        self, task: Task, waiting: list[_Waiting]
    ) -> Iterator[tuple[int, Outcome]]:
        """Yield each job's number and outcome. Jobs with too many contacts are repeated with more capacity.

        Args:
            task: that of all jobs.
            waiting: the jobs that can be in one batch.
        """
        while waiting:
            figures = self._find_figures(task, waiting[0].job)
            worlds = self._batch(task, [each.schedule for each in waiting], figures)
            now = waiting[: worlds.size.worlds]
            waiting = waiting[worlds.size.worlds :]

            jobs = [each.job for each in now]
            worlds.begin(
                [self._find_figures(task, job) for job in jobs],
                [job.trajectory for job in jobs],
            )
            outcomes = play_together(worlds, jobs)

            more = 2 * worlds.size.contacts
            again = []
            for each, outcome, crowded in zip(
                now, outcomes, worlds.crowded, strict=True
            ):
                if crowded and more <= _MOST_CONTACTS:
                    again.append(each)
                else:
                    yield each.number, outcome

            if again:
                self._contacts[figures.shared] = more
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

        frames = [len(schedule.marks) for schedule in schedules]
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


class _Waiting(NamedTuple):
    """A job that waits to be played: its number among all, and its schedule."""

    number: int
    schedule: Schedule

    @property
    def job(self) -> Rollout:
        return self.schedule.job


def _round_up(count: int) -> int:
    """Round up to a power of two."""
    return 1 << max(0, count - 1).bit_length()

"""Rollouts in MuJoCo, in one process and one thread, without a window."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence

import numpy as np

from core.design import Tool
from core.errors import NoPicture, UsageError, UserError, check_positive
from core.geometry import Array
from core.interfaces import Image, Outcome, Rollout, Simulator, Task
from core.kinematics import arm as panda_arm
from core.plugins import installed
from core.robot import FINGER_OPEN
from core.scene import Camera, Inertia, Scene, State
from core.trajectory import at_home
from plugins.simulators.mujoco.renderer import NoOpenGL, Renderer
from plugins.simulators.mujoco.world import Stepped, World, compiled

MAX_TIME_STEP = 0.005
_STAND_IN = "pybullet"
_KEPT = 4  # worlds: a chunk has one tool, mostly


class MuJoCoSimulator(Simulator):
    """One world per scene and tool, compiled once and played from the start for each job.

    Args:
        time_step: seconds.
        tracking_rate: how fast a joint closes in on its target, 1/s. It means the same at every time step.
        slip_rate: how fast friction stops what slips slowly, 1/s; what slips fast it stops as fast as the
            coefficient of friction lets it. Much faster, and what slides hops.
    """

    def __init__(self, time_step: float = 0.0025, tracking_rate: float = 50.0, slip_rate: float = 200.0) -> None:
        check_positive("sim.", time_step=time_step, tracking_rate=tracking_rate, slip_rate=slip_rate)
        if time_step > MAX_TIME_STEP:
            raise UsageError(f"sim.time_step must be at most {MAX_TIME_STEP} s, got {time_step}: contacts get soft")
        self.time_step = time_step
        self.tracking_rate = tracking_rate
        self.slip_rate = slip_rate
        self._scene: tuple[Task, int, Scene, dict[str, Inertia]] | None = None
        self._draws: Renderer | Simulator | None = None
        self._worlds: OrderedDict[tuple[Task, int, Tool], World] = OrderedDict()

    def rollout(self, task: Task, jobs: Sequence[Rollout]) -> list[Outcome]:
        return [self._world(task, job.seed, job.tool).play(job) for job in jobs]

    def world(self, task: Task, tool: Tool, seed: int = 0) -> Stepped:
        return self._world(task, seed, tool).stepped(at_home(task))

    def _world(self, task: Task, seed: int, tool: Tool) -> World:
        key = (task, seed, tool)
        if key not in self._worlds:
            if self._scene is None or self._scene[0] is not task or self._scene[1] != seed:
                scene = task.scene(seed)
                self._scene = task, seed, scene, {body.name: body.inertia() for body in scene.free}
            scene, inertias = self._scene[2:]
            model = compiled(scene, inertias, tool, self.time_step, self.tracking_rate, self.slip_rate)
            self._worlds[key] = World(scene, tool, model)
            if len(self._worlds) > _KEPT:
                self._worlds.popitem(last=False)
        self._worlds.move_to_end(key)
        return self._worlds[key]

    def render(
        self,
        task: Task,
        *,
        seed: int = 0,
        tool: Tool | None = None,
        arm: Array | None = None,
        fingers: Array | None = None,
        state: State | None = None,
        camera: Camera | None = None,
        width: int = 640,
        height: int = 480,
    ) -> Image:
        """By MuJoCo's own renderer where OpenGL draws without a window, otherwise by PyBullet's; ``drawn_by`` tells
        which it was.

        Raises:
            NoPicture: there is neither.
        """
        renderer = self._renderer()
        if not isinstance(renderer, Renderer):
            return renderer.render(
                task,
                seed=seed,
                tool=tool,
                arm=arm,
                fingers=fingers,
                state=state,
                camera=camera,
                width=width,
                height=height,
            )
        renderer.load(task, seed, tool)
        renderer.pose(
            arm if arm is not None else panda_arm().home_for(task.home),
            fingers if fingers is not None else np.full(2, FINGER_OPEN),
            state if state is not None else task.scene(seed).state(),
        )
        return renderer.shoot(camera or task.camera, width, height)

    def _renderer(self) -> Renderer | Simulator:
        if self._draws is not None:
            return self._draws
        try:
            own = Renderer()
        except NoOpenGL as error:
            missing = f"MuJoCo's own renderer needs OpenGL without a window ({error})"
            try:
                other: Simulator = installed().create("sim", _STAND_IN)
            except UserError as reason:
                raise NoPicture(f"{missing}, and {_STAND_IN}'s can't stand in for it: {reason}") from error
            self.drawn_by = f"{_STAND_IN}'s renderer: {missing}"
            self._draws = other
            return other
        self.drawn_by = f"MuJoCo's renderer on {own.device}"
        self._draws = own
        return own

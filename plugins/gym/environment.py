"""Step a task as a Gymnasium environment: an agent drives the arm, with a tool from a designs file."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, get_args

import gymnasium
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from core.config.compose import load, part, task_part, tool_part
from core.design import DesignError, Tool
from core.designs.reading import load_tool
from core.designs.rules import check_tool
from core.designs.start import SpawnRules
from core.errors import UserError, choices
from core.geometry import Array, Pose
from core.interfaces import Image, Recording, Task, ToolRepresentation, World
from core.plugins import SIMULATOR
from core.robot.kinematics import arm_of
from core.scene import State
from core.simulation.playback import begin_motion
from core.solids.contacts import find_contacts, make_trace
from core.support.text import shorten
from core.task import reward_of
from core.values.layouts import NONE
from core.values.traces import TRACE_HZ

ControlMode = Literal["joints", "end_effector"]
Numbers = npt.NDArray[np.float64]

STEP_S = 0.05  # of one action
SETTLE_S = 0.5  # before the first
MAX_SPEED = 0.5  # of the end-effector, m/s along each axis
MAX_TURN = 2.0  # and rad/s about each
FINGER_SPEED = 0.1  # m/s


class ToolEnv(gymnasium.Env[Numbers, Numbers]):
    """A task with one tool. An episode is one layout of the task's scene.

    Actions are in [-1, 1]. With ``control_mode="joints"`` (J,) they are speeds of the joint targets, as shares of the
    arm's limits. With ``"end_effector"`` (6,) they are speeds of the end-effector's target pose along and about the
    world's axes, as shares of 0.5 m/s and 2 rad/s. A tool for the gripper adds one: the fingers, -1 open to 1 closed.

    Observations (J + F + K + 13 B + 3 N,): J joints (rad), F fingers (m from the middle; none if the arm has no
    gripper), K joints of the tool (rad or m), for each of B free bodies the position (m), quaternion (w, x, y, z),
    linear (m/s) and angular (rad/s) velocity, in the world frame, and the places of all N nodes of soft bodies (m).
    Where the task has a variation, 7 M numbers follow: positions and quaternions of its M marks and fixed bodies.

    The reward of a step is the growth of the task's reward in it, so their sum over an episode is the task's reward at
    its end. ``info["reward"]`` is the task's reward now. An episode terminates at success. A reward may read the trace
    of the episode until now, but no forces: steps measure none.

    Args:
        task: the task's name.
        designs: a designs file, whose ``strategy`` (from 0) has the tool; None: the bare arm, or with ``gripper`` the
            bare hand.
        strategy: see ``designs``.
        words: settings as ``python -m core.evaluate`` takes them, such as ``["robot=ur5", "task.variation=wide"]``. The
            simulator must be one that can be stepped.
        gripper: see ``designs``.
        control_mode: what actions mean.
        render_mode: None or ``rgb_array``.
        size: width and height of pictures, pixels.

    Raises:
        UserError: an argument can't be used; says what is possible.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": round(1 / STEP_S)}  # noqa: RUF012  # Gymnasium's name

    def __init__(
        self,
        task: str,
        designs: str | Path | None = None,
        strategy: int = 0,
        *,
        words: Sequence[str] = (),
        gripper: bool = False,
        control_mode: ControlMode = "joints",
        render_mode: str | None = None,
        size: tuple[int, int] = (640, 480),
    ) -> None:
        if control_mode not in get_args(ControlMode):
            raise choices("control_mode", str(control_mode), get_args(ControlMode))
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise choices(
                "render_mode", str(render_mode), self.metadata["render_modes"]
            )
        config = load("evaluate", [f"task={task}", *words])
        self.task = task_part(config).create()
        self.simulator = part(SIMULATOR, config.sim).create()
        if gripper and self.task.robot.gripper is None:
            raise UserError(
                f"{self.task.robot.title} has no gripper; leave out gripper=True"
            )
        self.tool = Tool(gripper=gripper)
        if designs is not None:
            self.tool = _tool(
                Path(designs), strategy, tool_part(config).create(), self.task
            )
        self.control_mode = control_mode
        self.render_mode = render_mode
        self._draw = partial(
            self.simulator.render,
            self.task,
            tool=self.tool,
            width=size[0],
            height=size[1],
        )
        robot = self.task.robot
        self._arm = arm_of(robot)
        self._opening = robot.opening_m
        joints = len(robot.arm_joints)
        moves = (joints if control_mode == "joints" else 6) + self.tool.gripper

        scene = self.task.scene(0)
        observed = (
            joints
            + len(robot.finger_joints)
            + len(self.tool.bearers)
            + 13 * len(scene.free)
        )
        observed += 3 * sum(len(soft.form.nodes) for soft in scene.softs)
        if self.task.variation != NONE:
            observed += 7 * len(scene.places)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (moves,), np.float64)
        self.observation_space = gymnasium.spaces.Box(
            -np.inf, np.inf, (observed,), np.float64
        )
        self._world: World | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Start an episode in a layout that ``seed`` draws, and let it settle."""
        super().reset(seed=seed)
        self._layout = int(self.np_random.integers(2**31))
        self._scene = self.task.scene(self._layout)
        world = self.simulator.world(self.task, self.tool, self._layout)
        self._world = world
        self._joints = self._arm.home_for(self.task.home)
        self._fingers = self._opening
        self._pose = self._arm.forward(self._joints)
        self._film: list[Recording] = []
        self._elapsed = -SETTLE_S
        self._drive(world, self._joints, self._fingers, SETTLE_S)
        self._start = begin_motion(world)
        try:
            self._earned = self._reward(world, self._start)
        except ValueError as error:
            raise UserError(
                f"{self.task.name} can't be stepped: {error}; use python -m core.evaluate"
            ) from error
        return self._observation(world), {"reward": self._earned}

    def step(
        self, action: Numbers
    ) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        """Drive the arm for 0.05 s.

        Raises:
            ResetNeeded: there is no world yet.
            InvalidAction: the action has another shape, or a number that is not finite.
        """
        if self._world is None:
            raise gymnasium.error.ResetNeeded("call reset before step")
        action = np.clip(self._checked(action), -1.0, 1.0)
        fingers = self._fingers
        if self.tool.gripper:
            wanted = self._opening * (1 - action[-1]) / 2
            fingers += float(
                np.clip(wanted - fingers, -FINGER_SPEED * STEP_S, FINGER_SPEED * STEP_S)
            )
        self._drive(self._world, self._target(action), fingers, STEP_S)

        before = self._earned
        self._earned = self._reward(self._world, self._world.state())
        done = self._earned >= self.task.success_reward
        info = {"reward": self._earned, "is_success": done}
        return self._observation(self._world), self._earned - before, done, False, info

    def _checked(self, action: Any) -> Numbers:
        """Return an action as an array, if it is one."""
        (count,) = self.action_space.shape or (0,)
        with suppress(TypeError, ValueError):
            numbers = np.asarray(action, dtype=np.float64)
            if numbers.shape == (count,) and np.isfinite(numbers).all():
                return numbers
        wanted = f"an action is {count} finite numbers from -1 to 1, see plugins.gym.environment.ToolEnv"
        raise gymnasium.error.InvalidAction(f"{wanted}; got {shorten(repr(action))}")

    def _target(self, action: Numbers) -> Array:
        """Joint targets (J,) at the end of the step, within the limits of angle and speed."""
        arm = self._arm
        fastest = arm.velocity_limits * STEP_S
        if self.control_mode == "joints":
            joints = self._joints + action[: len(fastest)] * fastest
        else:
            turn = Rotation.from_rotvec(action[3:6] * MAX_TURN * STEP_S)
            position = self._pose.position + action[:3] * MAX_SPEED * STEP_S
            wanted = Pose.from_rotation(position, turn * self._pose.rotation)
            joints = arm.inverse(wanted, self._joints).joints
        joints = np.clip(joints, self._joints - fastest, self._joints + fastest)
        return np.clip(joints, arm.lower, arm.upper)

    def _drive(
        self, world: World, joints: Array, fingers: float, seconds: float
    ) -> None:
        """Move the targets evenly to these within ``seconds``."""
        steps = max(1, round(seconds / world.time_step))
        span = steps * world.time_step
        speeds = (joints - self._joints) / span
        finger_speed = (fingers - self._fingers) / span
        for k in range(1, steps + 1):
            if self.task.reads_trace and (self._elapsed + SETTLE_S) * TRACE_HZ >= len(
                self._film
            ):
                self._film.append(self._instant(world))
            left = span - k * world.time_step
            world.step(
                joints - speeds * left,
                fingers - finger_speed * left,
                speeds,
                finger_speed,
            )
            self._elapsed += world.time_step
        self._joints = joints
        self._fingers = fingers
        self._pose = self._arm.forward(
            joints
        )  # where the arm can't follow, the target doesn't run away

    def _reward(self, world: World, now: State) -> float:
        """The task's reward; its trace, if it reads one, is of the episode until now, without forces."""
        trace = None
        if self.task.reads_trace:
            film = [*self._film, self._instant(world)]
            recording = Recording(
                times=np.array([instant.times for instant in film]),
                arm=np.array([instant.arm for instant in film]),
                fingers=np.array([instant.fingers for instant in film]),
                states=State.stack([instant.states for instant in film]),
            )
            found = find_contacts(self._scene, self.task.robot, self.tool, recording)
            trace = replace(make_trace(self._scene, [found])[0], forces=None)
        first = self._scene.complete(self._start)
        return float(
            np.asarray(reward_of(self.task, first, self._scene.complete(now), trace))
        )

    def _instant(self, world: World) -> Recording:
        return Recording(np.array(self._elapsed), *world.joints(), world.state())

    def _observation(self, world: World) -> Numbers:
        state = world.state()
        nodes = [state.nodes(soft.name).ravel() for soft in self._scene.softs]
        fixed: list[Array] = []
        if self.task.variation != NONE:
            for pose in self._scene.places.values():
                fixed += [pose.position, pose.quaternion]
        return np.concatenate(
            [
                *world.joints(),
                np.concatenate(state.arrays, axis=-1).ravel(),
                *nodes,
                *fixed,
            ]
        )

    def render(self) -> Image | None:
        """Draw a picture (height, width, 3); None without a ``render_mode``."""
        if self.render_mode is None or self._world is None:
            return None
        arm, fingers = self._world.joints()
        if not self.tool.gripper:
            fingers[: len(self.task.robot.finger_joints)] = self._opening
        return self._draw(
            seed=self._layout, arm=arm, fingers=fingers, state=self._world.state()
        )

    def close(self) -> None:
        self._world = None


def _tool(
    designs: Path, strategy: int, representation: ToolRepresentation, task: Task
) -> Tool:
    tool = load_tool(designs, strategy, representation, task)
    try:
        if tool.components:
            check_tool(tool, task.robot, representation.material)
        SpawnRules(task, 0).check(tool)
    except DesignError as error:
        raise UserError(
            f"{designs}: the tool of strategy {strategy} can't be mounted: {error}"
        ) from error
    return tool

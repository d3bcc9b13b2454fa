"""Step a task as a Gymnasium environment: an agent drives the arm, with a tool from a designs file."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
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
from core.interfaces import Image, Order, Task, ToolRepresentation, World
from core.plugins import SIMULATOR
from core.robot.kinematics import arm_of
from core.scene import State
from core.support.text import shorten
from core.task import reward_of
from plugins.gym.environment.film import SETTLE_S, Film

ControlMode = Literal["joints", "end_effector"]
Numbers = npt.NDArray[np.float32]

STEP_S = 0.05  # of one action
MAX_SPEED = 0.5  # of the end-effector, m/s along each axis
MAX_TURN = 2.0  # and rad/s about each
FINGER_SPEED = 0.1  # m/s

MOST = 100.0  # of any number that is observed


class ToolEnv(gymnasium.Env[Numbers, Numbers]):
    """A task with one tool. An episode is one layout of the task's scene.

    Actions are in [-1, 1]. With ``control_mode="joints"`` (J,) they are speeds of the joint targets, as shares of the
    arm's limits. With ``"end_effector"`` (6,) they are speeds of the end-effector's target pose along and about the
    world's axes, as shares of 0.5 m/s and 2 rad/s. A tool for the gripper adds one: the fingers, -1 open to 1 closed.

    Observations (J + F + K + 13 B + 3 N + 7 + 7 M,): J joints (rad), F fingers (m from the middle; none if the
    arm has no gripper), K joints of the tool (rad or m), for each of B free bodies the position (m), quaternion
    (w, x, y, z), linear (m/s) and angular (rad/s) velocity, in the world frame, and the places of all N nodes of soft
    bodies (m). The end-effector's position and quaternion follow, and those of M marks, where goals are, and fixed
    bodies. Numbers beyond the bounds are cut off.

    The reward of a step is the growth of the task's reward in it, so their sum over an episode is the task's reward at
    its end. ``info["reward"]`` is the task's reward now. An episode terminates at success. A reward may read the trace
    of the episode until now, but no forces: steps measure none.

    Args:
        task: the task's name.
        designs: a designs file, whose ``strategy`` (from 0) has the tool; None: the bare arm, or with ``gripper`` the
            bare hand.
        strategy: see ``designs``.
        words: settings as ``vlmgineer evaluate`` takes them, such as ``["robot=ur5", "task.variation=wide"]``. The
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

        render_modes = self.metadata["render_modes"]
        if render_mode not in (None, *render_modes):
            raise choices("render_mode", str(render_mode), render_modes)

        config = load("evaluate", [f"task={task}", *words])
        self.task = task_part(config).create()
        self.simulator = part(SIMULATOR, config.sim).create()

        robot = self.task.robot
        if gripper and robot.gripper is None:
            raise UserError(f"{robot.title} has no gripper; leave out gripper=True")

        self.tool = Tool(gripper=gripper)
        if designs is not None:
            representation = tool_part(config).create()
            self.tool = _load_mounted_tool(
                Path(designs), strategy, representation, self.task
            )

        self.control_mode = control_mode
        self.render_mode = render_mode
        self._size = size
        self._arm = arm_of(robot)
        self._opening = robot.opening_m
        self._world: World | None = None

        moves = len(robot.arm_joints) if control_mode == "joints" else 6
        moves += self.tool.gripper
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (moves,), np.float32)
        observed = self._count_observations()
        self.observation_space = gymnasium.spaces.Box(
            -MOST, MOST, (observed,), np.float32
        )

    def _count_observations(self) -> int:
        """Count the numbers that an agent sees; see the class."""
        robot = self.task.robot
        scene = self.task.scene(0)
        joints = len(robot.arm_joints) + len(robot.finger_joints)
        count = joints + len(self.tool.bearers) + 13 * len(scene.free)
        count += 3 * sum(len(soft.form.nodes) for soft in scene.softs)

        return count + 7 * (1 + len(scene.places))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Numbers, dict[str, Any]]:
        """Start an episode in a layout, and let it settle.

        Args:
            seed: draws the layout; None: the episode before does.
            options: none are known.

        Returns:
            the first observation, and the task's reward now.

        Raises:
            UserError: the task's reward needs what steps don't measure.
        """
        super().reset(seed=seed)
        self._layout = int(self.np_random.integers(2**31))
        self._scene = self.task.scene(self._layout)
        self._film = Film(self._scene, self.task.robot, self.tool)

        self._elapsed = -SETTLE_S
        self._joints = self._arm.home_for(self.task.home)
        self._fingers = self._opening
        self._pose = self._arm.forward(self._joints)

        world = self.simulator.world(self.task, self.tool, self._layout)
        self._world = world
        self._drive(world, self._joints, self._fingers, SETTLE_S)
        world.launch()
        self._start = world.state()
        try:
            self._earned, _ = self._judge(world, self._start)
        except ValueError as error:
            raise UserError(
                f"{self.task.name} can't be stepped: {error}; use vlmgineer evaluate"
            ) from error

        return self._observation(world), {"reward": self._earned}

    def step(
        self, action: Numbers
    ) -> tuple[Numbers, float, bool, bool, dict[str, Any]]:
        """Drive the arm for 0.05 s.

        Args:
            action: see the class.

        Returns:
            the observation, what the reward grew by, if the episode is done, False, and the task's reward now.

        Raises:
            ResetNeeded: there is no world yet.
            InvalidAction: the action has another shape, or a number that is not finite.
        """
        world = self._world
        if world is None:
            raise gymnasium.error.ResetNeeded("call reset before step")

        shares = np.clip(self._check(action), -1.0, 1.0)
        fingers = self._fingers

        if self.tool.gripper:
            wanted = self._opening * (1 - shares[-1]) / 2
            most = FINGER_SPEED * STEP_S
            fingers += float(np.clip(wanted - fingers, -most, most))

        self._drive(world, self._target(shares), fingers, STEP_S)

        before = self._earned
        self._earned, done = self._judge(world, world.state())
        info = {"reward": self._earned, "is_success": done}

        return self._observation(world), self._earned - before, done, False, info

    def _check(self, action: Any) -> Array:
        """Return an action as an array, if it is one."""
        shape = self.action_space.shape
        with suppress(TypeError, ValueError):
            numbers = np.asarray(action, dtype=np.float64)
            if numbers.shape == shape and np.isfinite(numbers).all():
                return numbers

        raise gymnasium.error.InvalidAction(
            f"an action is an array {shape} of finite numbers from -1 to 1; got {shorten(repr(action))}"
        )

    def _target(self, action: Array) -> Array:
        """Return joint targets (J,) at the end of the step, within the limits of angle and speed.

        Args:
            action: within -1 to 1.
        """
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
        """Move the targets evenly to these.

        Args:
            world: is stepped.
            joints: targets (J,), radians.
            fingers: each finger's distance from the middle, metres.
            seconds: how long it takes.
        """
        steps = max(1, round(seconds / world.time_step))
        span = steps * world.time_step
        speeds = (joints - self._joints) / span
        finger_speed = (fingers - self._fingers) / span

        for k in range(1, steps + 1):
            if self.task.reads_trace:
                self._film.add(self._elapsed, world)

            left = span - k * world.time_step
            arm_target = joints - speeds * left
            finger_target = fingers - finger_speed * left
            world.step(
                Order(arm_target.tolist(), finger_target, speeds.tolist(), finger_speed)
            )
            self._elapsed += world.time_step

        self._joints = joints
        self._fingers = fingers
        # Where the arm can't follow, the target doesn't run away.
        self._pose = self._arm.forward(joints)

    def _judge(self, world: World, now: State) -> tuple[float, bool]:
        """Compute the task's reward, and say whether it is solved.

        Args:
            world: is read for the trace of the episode until now, which has no forces; most rewards read none.
            now: the state.
        """
        trace = None
        if self.task.reads_trace:
            trace = self._film.trace(self._elapsed, world)

        begun = self._scene.complete(self._start)
        end = self._scene.complete(now)
        reward = float(np.asarray(reward_of(self.task, begun, end, trace)))

        return reward, self.task.is_solved(reward, begun, end, trace)

    def _observation(self, world: World) -> Numbers:
        """Return the numbers that an agent sees; see the class.

        Args:
            world: is read as it is now.
        """
        state = world.state()
        bodies = np.concatenate(state.arrays, axis=-1).ravel()
        nodes = [state.nodes(soft.name).ravel() for soft in self._scene.softs]
        joints, fingers = world.joints()

        poses = [self._arm.forward(joints), *self._scene.places.values()]
        places: list[Array] = []
        for pose in poses:
            places += [pose.position, pose.quaternion]

        seen = np.concatenate([joints, fingers, bodies, *nodes, *places])

        return np.clip(seen.astype(np.float32), -MOST, MOST)

    def render(self) -> Image | None:
        """Draw a picture (height, width, 3); None without a ``render_mode``, or before the first episode."""
        if self.render_mode is None or self._world is None:
            return None

        arm, fingers = self._world.joints()
        width, height = self._size

        return self.simulator.render(
            self.task,
            seed=self._layout,
            tool=self.tool,
            width=width,
            height=height,
            arm=arm,
            fingers=fingers,
            state=self._world.state(),
        )

    def close(self) -> None:
        """Forget the world."""
        self._world = None


def _load_mounted_tool(
    designs: Path, design: int, representation: ToolRepresentation, task: Task
) -> Tool:
    """Read a tool, and check that it can be mounted.

    Args:
        designs: a designs file.
        design: the number of the tool in it, from 0.
        representation: reads it.
        task: in whose first layout it must start clear of everything.

    Raises:
        UserError: the file, or the tool, can't be used.
    """
    tool = load_tool(designs, design, representation, task)
    try:
        if tool.components:
            check_tool(tool, task.robot, representation.material)
        SpawnRules(task, 0).check(tool)
    except DesignError as error:
        raise UserError(
            f"{designs}: the tool of design {design} can't be mounted: {error}"
        ) from error

    return tool

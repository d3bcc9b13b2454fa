"""Provide what the checks give a simulator: small worlds, and an arm that waits or moves in them."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np

from core.design import DesignError, Tool
from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import (
    JointTrajectory,
    Outcome,
    Recording,
    Robot,
    Rollout,
    Simulator,
    Task,
    Waypoints,
)
from core.plugins import installed
from core.robot.kinematics import Arm, arm_of
from core.robot.trajectory import plan_motion
from core.scene import Body, Bond, Joint, Scene, State
from core.simulation.engines import check_support, scene_of
from plugins.conformance.shared import LeftOut, expect

T = TypeVar("T")
Size = tuple[float, float, float]
HOME = Pose(np.array([0.5, 0.0, 0.5]))
GRAVITY = 9.81
FILM_HZ = 100.0
BARE = Tool()
HAND = Tool(gripper=True)


class Bodies(Task):
    """A task of these bodies for a robot, by default the default one, in which every reward is 0."""

    name = "Bodies"
    description = "Bodies."
    goals = ()

    def __init__(
        self,
        *bodies: Body,
        joints: tuple[Joint, ...] = (),
        bonds: tuple[Bond, ...] = (),
        robot: Robot | None = None,
    ) -> None:
        self.robot = robot or installed().default_robot
        self._scene = Scene(bodies, joints, bonds=bonds)

    def scene(self, seed: int) -> Scene:
        return self._scene

    def reward(self, start: State, end: State) -> Array:
        return np.zeros(start.positions.shape[:-2])


def arm(robot: Robot | None = None) -> Arm:
    """The arm of a robot, by default of the default one."""
    return arm_of(robot or installed().default_robot)


def opened(count: int = 1) -> Array:
    """Targets (T,) of open fingers of the default robot."""
    return np.full(count, installed().default_robot.opening_m)


@lru_cache(maxsize=4)
def still(robot: Robot | None = None) -> JointTrajectory:
    """A trajectory that holds the arm at home, with open fingers."""
    here = arm(robot)
    return JointTrajectory(
        np.zeros(1), here.home_for(HOME)[None], np.array([here.robot.opening_m])
    )


def motion(plan: object, robot: Robot | None = None) -> JointTrajectory:
    """The motion from home through waypoints (N, 6) or (N, 7), see `core.design.Candidate`."""
    waypoints = Waypoints(np.array(plan, dtype=np.float64))
    return plan_motion(waypoints, HOME, arm(robot)).trajectory


def wait(
    simulator: Simulator,
    *bodies: Body,
    seconds: float = 1.0,
    settle_s: float = 0.0,
    record_hz: float = 0.0,
    tool: Tool = BARE,
) -> Outcome:
    """Simulate bodies while the arm stays at home."""
    job = Rollout(tool, still(), 0, settle_s, seconds, record_hz)
    return play(simulator, Bodies(*bodies), job)


def move(
    simulator: Simulator,
    plan: object,
    *bodies: Body,
    tool: Tool = BARE,
    record_hz: float = 0.0,
    hold_s: float = 0.5,
) -> Outcome:
    """Simulate a motion through waypoints."""
    job = Rollout(tool, motion(plan), 0, 0.1, hold_s, record_hz)
    return play(simulator, Bodies(*bodies), job)


def play(simulator: Simulator, task: Task, job: Rollout) -> Outcome:
    """Simulate one job of a task; it must not break.

    Raises:
        LeftOut: the engine does not support what it needs.
    """
    try:
        check_support(simulator, task.name, scene_of(job, task), job)
    except (DesignError, UserError) as error:
        raise LeftOut(str(error)) from error

    (outcome,) = simulator.rollout(task, [job])
    expect(outcome.error is None, f"a rollout broke: {outcome.error}")
    return outcome


class Film(NamedTuple):
    """What came of a scene: instants (T,), the states there with fixed bodies and joints, and all that was recorded."""

    times: Array
    states: State
    recording: Recording


def watch(
    simulator: Simulator,
    scene: Scene,
    seconds: float,
    settle_s: float = 0.0,
    hz: float = FILM_HZ,
    tool: Tool = BARE,
    trajectory: JointTrajectory | None = None,
    forces: bool = False,
) -> Film:
    """Play a scene while the arm waits for so long, at first or after a trajectory, and record it."""
    task = Bodies(*scene.bodies, joints=scene.joints, bonds=scene.bonds)
    way = still() if trajectory is None else trajectory
    job = Rollout(tool, way, 0, settle_s, seconds, hz, forces)
    recording = film(play(simulator, task, job))
    return Film(recording.times, scene.complete(recording.states), recording)


def start(outcome: Outcome) -> State:
    return _given(outcome.start, "an outcome without an error has no start state")


def end(outcome: Outcome) -> State:
    return _given(outcome.end, "an outcome without an error has no end state")


def film(outcome: Outcome) -> Recording:
    return _given(outcome.recording, "record_hz was given, and nothing was recorded")


def _given(value: T | None, problem: str) -> T:
    if value is None:
        raise AssertionError(problem)
    return value

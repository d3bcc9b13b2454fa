"""Provide what the checks give a simulator: bodies, small worlds, and an arm that waits or moves in them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from core.design import DesignError, Tool
from core.errors import UserError
from core.geometry import Array, Box, Pose, Shape, Vector
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
from core.scene import Body, Bond, Color, Geom, Joint, Scene, State
from core.simulation.engines import check_support, scene_of
from plugins.conformance.shared import LeftOut

GREY: Color = (0.5, 0.5, 0.5, 1.0)
FAR = (3.0, 3.0, 0.0)  # from the arm
HOME = Pose(np.array([0.5, 0.0, 0.5]))
GRAVITY = 9.81
BARE = Tool()
HAND = Tool(gripper=True)


# --- bodies ----------------------------------------------------------------------------------------------------


def make_body(
    name: str, shape: Shape, position: Vector, mass: float = 0.0, **more: Any
) -> Body:
    """A grey body of one shape; without a mass it is fixed."""
    return Body.of(name, shape, position, mass=mass, color=GREY, **more)


def cube(
    name: str = "cube",
    at: Vector = (0.0, 0.0, 0.0),
    side: float = 0.1,
    mass: float = 1.0,
) -> Body:
    return make_body(name, Box((side, side, side)), at, mass)


def compound(name: str, *parts: Geom, at: Vector, mass: float = 0.0) -> Body:
    return Body(name, Pose.xyz_rpy(at), mass, parts, parts)


def part(shape: Shape, *at: float) -> Geom:
    return Geom(shape, Pose.xyz_rpy(at or (0.0, 0.0, 0.0)))


def slope(tilt: float, friction: float) -> Body:
    """A fixed slab 0.1 thick, far from the arm, that falls ``tilt`` radians toward +x; its frame is in its middle."""
    slab = Box((4.0, 1.0, 0.1))
    return make_body("slope", slab, FAR, rpy=(0.0, tilt, 0.0), friction=friction)


# --- the arm ----------------------------------------------------------------------------------------------------


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
    joints = here.home_for(HOME)[None]
    return JointTrajectory(np.zeros(1), joints, np.array([here.robot.opening_m]))


def motion(plan: object, robot: Robot | None = None) -> JointTrajectory:
    """The motion from home through waypoints (N, 6) or (N, 7), see `core.design.Candidate`."""
    waypoints = Waypoints(np.array(plan, dtype=np.float64))
    return plan_motion(waypoints, HOME, arm(robot)).trajectory


# --- playing ----------------------------------------------------------------------------------------------------


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
    assert outcome.error is None, f"a rollout broke: {outcome.error}"
    return outcome


@dataclass(frozen=True)
class Film:
    """What came of a scene that was played and recorded.

    Attributes:
        scene: that was played.
        outcome: of the rollout.
    """

    scene: Scene
    outcome: Outcome

    @property
    def start(self) -> State:
        found = self.outcome.start
        assert found is not None, "an outcome without an error has no start state"
        return found

    @property
    def end(self) -> State:
        found = self.outcome.end
        assert found is not None, "an outcome without an error has no end state"
        return found

    @cached_property
    def recording(self) -> Recording:
        found = self.outcome.recording
        assert found is not None, "record_hz was given, and nothing was recorded"
        return found

    @cached_property
    def states(self) -> State:
        """The states at each instant (T,), with fixed bodies and joints."""
        return self.scene.complete(self.recording.states)

    @property
    def times(self) -> Array:
        return self.recording.times

    def path(self, name: str) -> Array:
        """Where a body is at each instant, (T, 3) m."""
        return self.states.position(name)

    def spin(self, name: str) -> Array:
        """How a body spins at the end, (3,) rad/s."""
        last: Array = self.states.angular_velocities[-1, self.states.names.index(name)]
        return last

    def moved(self, name: str) -> float:
        """How far a body ends from where it was put, m."""
        first, *_, last = self.path(name)
        return float(np.linalg.norm(last - first))


def watch(
    simulator: Simulator,
    *bodies: Body,
    joints: tuple[Joint, ...] = (),
    bonds: tuple[Bond, ...] = (),
    tool: Tool = BARE,
    way: JointTrajectory | None = None,
    **job: Any,
) -> Film:
    """Play bodies while the arm waits at home, or goes its way, and record that.

    ``job`` has further fields of the `Rollout`; by default nothing settles, and 100 instants a second are recorded.
    """
    task = Bodies(*bodies, joints=joints, bonds=bonds)
    job = {"settle_s": 0.0, "record_hz": 100.0, **job}
    outcome = play(simulator, task, Rollout(tool, way or still(), **job))
    return Film(task.scene(0), outcome)

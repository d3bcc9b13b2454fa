"""Convert between the size of the arm that stands in the lab and the size in which it is simulated.

A small arm is simulated larger (`robot.reach`). The workshop computes and writes everything in the arm's own size; only
what plays a motion (`plugins.results.workshop.stage`) or carries out a plan works in the simulated size.

Conversions follow Froude's rule. Where lengths grow by k and densities stay, times grow by k^(1/2), masses and forces
by k^3, torques by k^4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from core.design import Component, Tool
from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import JointTrajectory, Motion, Recording
from core.scene import Body, Geom, Scene, Soft, State
from core.values.robots import Robot
from core.values.tools import Fixture, ToolJoint
from plugins.results.workshop.motion import Sampled


@dataclass(frozen=True)
class Ratio:
    """How many times as large one size is as another.

    ``to_life(robot)`` leads from the simulated size to the arm's own one, and its inverse back::

        small = to_life(task.robot).tool(tool)

    Attributes:
        length: by which lengths are multiplied.
        slides: whether each of the arm's joints slides (J,); empty: all turn.
    """

    length: float
    slides: tuple[bool, ...] = ()

    @property
    def inverse(self) -> Ratio:
        return Ratio(1 / self.length, self.slides)

    def joints(self, values: Array) -> Array:
        """Convert positions (..., J) of the arm's joints: those that slide grow."""
        if not any(self.slides):
            return values

        return values * np.where(self.slides, self.length, 1.0)

    @property
    def time(self) -> float:
        return math.sqrt(self.length)

    @property
    def force(self) -> float:
        """Also that of masses."""
        return self.length**3

    @property
    def torque(self) -> float:
        return self.length**4

    def pose(self, pose: Pose) -> Pose:
        return Pose(self.length * pose.position, pose.quaternion)

    def tool(self, tool: Tool) -> Tool:
        """Convert a tool with its masses, its joints and its fixture."""
        if self.length == 1:
            return tool

        fixture = tool.fixture
        if fixture is not None:
            fixture = Fixture(self.tool(fixture.parts), self.pose(fixture.pose))

        components = tuple(map(self._component, tool.components))
        return replace(tool, components=components, fixture=fixture)

    def _component(self, component: Component) -> Component:
        joint = component.joint
        return replace(
            component,
            pose=self.pose(component.pose),
            shape=component.shape.scaled(self.length),
            mass=self.force * component.mass,
            joint=None if joint is None else self._joint(joint),
        )

    def _joint(self, joint: ToolJoint) -> ToolJoint:
        x, y, z = (self.length * value for value in joint.origin)
        if joint.kind == "hinge":
            way = 1.0
            effort = self.torque
        else:
            way = self.length
            effort = self.force

        return replace(
            joint,
            origin=(x, y, z),
            lower=way * joint.lower,
            upper=way * joint.upper,
            rest=way * joint.rest,
            friction=effort * joint.friction,
            stiffness=effort / way * joint.stiffness,
            damping=effort * self.time / way * joint.damping,
        )

    def scene(self, scene: Scene) -> Scene:
        """Convert the bodies of a scene, as they are seen, touched and weighed; joints and bonds are left out.

        Raises:
            UserError: a body is soft.
        """
        if self.length == 1:
            return scene

        bodies = tuple(map(self._body, scene.bodies))
        return Scene(bodies, gravity=scene.gravity)

    def _body(self, body: Body) -> Body:
        if isinstance(body, Soft):
            raise UserError(
                f"{body.name} is soft, and soft bodies have no size but that of the task: export the design of an arm "
                "without robot.reach"
            )

        return replace(
            body,
            pose=self.pose(body.pose),
            mass=self.force * body.mass,
            visuals=tuple(map(self._geom, body.visuals)),
            collisions=tuple(map(self._geom, body.collisions)),
        )

    def _geom(self, geom: Geom) -> Geom:
        return replace(
            geom, shape=geom.shape.scaled(self.length), pose=self.pose(geom.pose)
        )

    def recording(self, recording: Recording, tool: Tool) -> Recording:
        """Convert the recording of a rollout with a tool."""
        if self.length == 1:
            return recording

        ways = [
            1.0 if bearer.joint.kind == "hinge" else self.length
            for bearer in tool.bearers
        ]
        fingers = recording.fingers.shape[1] - len(ways)
        pushes = recording.pushes
        if pushes is not None:
            pushes = replace(
                pushes,
                points=self.length * pushes.points,
                forces=self.force * pushes.forces,
            )

        return Recording(
            times=self.time * recording.times,
            arm=self.joints(recording.arm),
            fingers=recording.fingers * np.array([self.length] * fingers + ways),
            states=self._states(recording.states),
            forces={k: self.force * v for k, v in recording.forces.items()},
            pushes=pushes,
        )

    def _states(self, states: State) -> State:
        """Convert the states that an engine returns."""
        return replace(
            states,
            positions=self.length * states.positions,
            linear_velocities=self.time * states.linear_velocities,
            angular_velocities=states.angular_velocities / self.time,
        )

    def trajectory(self, trajectory: JointTrajectory) -> JointTrajectory:
        return JointTrajectory(
            self.time * trajectory.times,
            self.joints(trajectory.arm),
            self.length * trajectory.fingers,
        )

    def motion(self, motion: Motion) -> Motion:
        """Convert a planned motion with its waypoints."""
        columns = motion.plan.shape[1]
        to_plan: Array = np.ones(columns)
        to_plan[:3] = self.length
        return Motion(
            self.trajectory(motion.trajectory),
            self.length * motion.distance_m,
            self.time * motion.arrivals,
            motion.misses * np.array([self.length, 1.0]),
            motion.plan * to_plan,
            motion.slowed,
        )

    def samples(self, samples: Sampled) -> Sampled:
        return replace(
            samples,
            times=self.time * samples.times,
            positions=self.joints(samples.positions),
            velocities=self.joints(samples.velocities) / self.time,
            accelerations=self.joints(samples.accelerations) / self.length,
            fingers=self.length * samples.fingers,
        )


def to_life(robot: Robot) -> Ratio:
    """Return what leads from the size in which a robot is simulated to that of the arm that stands in the lab."""
    return Ratio(1 / robot.enlarged, robot.slides)

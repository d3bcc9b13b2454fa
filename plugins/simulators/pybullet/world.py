"""Build and step one PyBullet world with its scene and the robot with a tool."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import RIGID_MOUNT, Tool
from core.geometry import Array
from core.interfaces import Order, Robot, Rollout
from core.scene import State
from plugins.simulators.forces import Thing, thing_of
from plugins.simulators.fresh import FreshWorld
from plugins.simulators.pybullet.arm import ArticulatedArm
from plugins.simulators.pybullet.bodies import PreparedScene
from plugins.simulators.pybullet.bonds import Bonds
from plugins.simulators.pybullet.engine import Client
from plugins.simulators.pybullet.engine import pybullet as p
from plugins.simulators.pybullet.forces import Forces, pushes
from plugins.simulators.pybullet.grips import Grips
from plugins.simulators.pybullet.mechanisms import Mechanism, Place

# How far bodies may slide before a stored contact point is dropped, as a share of a shape's radius. PyBullet's default,
# ten times as much, lets stacks creep on outdated points.
_CONTACT_DRIFT = 0.002


class Settings(NamedTuple):
    """Settings of `sim=pybullet`, see there."""

    solver_iterations: int
    tracking_rate: float
    separation_rate: float


class World(FreshWorld):
    """The robot at a trajectory's first targets, and free bodies at their initial poses.

    Args:
        client: what was there before ends.
        scene: its bodies.
        robot: the arm.
        file: describes the robot with the job's tool.
        job: says the motion, and if forces are measured.
        time_step: seconds; joints of the scene may need shorter ones.
        settings: of the engine.
    """

    def __init__(
        self,
        client: Client,
        scene: PreparedScene,
        robot: Robot,
        file: Path,
        job: Rollout,
        time_step: float,
        settings: Settings,
    ) -> None:
        self.client = client
        self._scene = scene
        self.time_step = time_step / scene.count_steps(time_step)
        gain = 1.0 - float(np.exp(-settings.tracking_rate * self.time_step))
        separation = 1.0 - float(np.exp(-settings.separation_rate * self.time_step))

        client.resetSimulation()
        client.setGravity(*scene.gravity)
        client.setPhysicsEngineParameter(
            fixedTimeStep=self.time_step,
            numSolverIterations=settings.solver_iterations,
            numSubSteps=0,
            contactERP=separation,
            contactBreakingThreshold=_CONTACT_DRIFT,
            deterministicOverlappingPairs=1,
        )
        if scene.jointed:  # else a joint leaves its limit a fifth as fast as it came
            client.setPhysicsEngineParameter(erp=separation)

        self._places = scene.place(client)
        self._free = [self._places[name] for name in scene.names]
        self._arm = ArticulatedArm(
            client,
            file,
            robot,
            job.tool,
            job.trajectory,
            gain,
        )

        joints = []
        for tree in scene.jointed:
            joints += [(self._places[joint.body], joint) for joint in tree.joints]

        self._mechanism = Mechanism(
            client,
            joints,
            gain,
            self.time_step,
        )
        if job.forces and job.record_hz > 0:
            self.impulses = Forces(client, self._name_things(job.tool), self.time_step)
        if scene.scene.bonds:
            self.bonds = Bonds(client, scene.scene, self._places, scene.offsets)
        if job.tool.gripping:
            self.gripping = Grips(
                client,
                robot,
                job.tool,
                scene.scene,
                self._places,
                (self._arm.number, self._arm.links[RIGID_MOUNT]),
                self.time_step,
            )

    def _name_things(self, tool: Tool) -> dict[Place, Thing]:
        """Map all that collides to what contact forces call it."""
        things: dict[Place, Thing] = {}
        for name, link in self._arm.links.items():
            things[self._arm.number, link] = thing_of(tool, name)

        for name, place in self._places.items():
            things[place] = (self._scene.ranks[name], name)

        return things

    def step(self, order: Order) -> None:
        self._arm.drive(order)
        if self._mechanism.acts:
            self._mechanism.drive()

        p.stepSimulation(self.client.number)
        self.end_step(order)

    def launch(self) -> None:
        if self.gripping is not None:
            self.gripping.launch()
        for place, joint in self._arm.list_loose():
            self._mechanism.add(place, joint)
        self._mechanism.launch()

        for body in self._scene.launched:
            number, _ = self._places[body.name]
            linear = np.array(body.velocity, dtype=np.float64)
            offset = self._scene.offsets[body.name]
            # PyBullet takes the velocity of the centre of mass.
            _, quaternion = self.client.getBasePositionAndOrientation(number)
            turn = Rotation.from_quat(quaternion).as_matrix()
            linear -= np.cross(body.spin, turn @ offset.position)
            self.client.resetBaseVelocity(number, linear.tolist(), body.spin)

    def note_torques(self) -> tuple[float, ...]:
        return self._arm.note_torques()

    def pushes(self) -> tuple[Array, Array]:
        return pushes(self.client, self._arm.number, self._arm.beyond)

    def joints(self) -> tuple[Array, Array]:
        arm, fingers = self._arm.read([self._arm.snapshot()])
        return arm[0], fingers[0]

    def snapshot(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        return self._arm.snapshot(), self._take_bodies()

    def decode(self, snapshots: Sequence[Any]) -> tuple[Array, Array, State]:
        joints, bodies = zip(*snapshots, strict=True)
        return *self._arm.read(joints), self._scene.read(bodies)

    def _take_bodies(self) -> tuple[float, ...]:
        """Take the numbers of all free bodies, see `PreparedScene.read`."""
        client = self.client.number
        found: list[float] = []
        for body, link in self._free:
            if link < 0:
                position, quaternion = p.getBasePositionAndOrientation(body, client)
                linear, angular = p.getBaseVelocity(body, client)
            else:
                moving = self.client.getLinkState(
                    body,
                    link,
                    1,
                    1,
                )
                position = moving[0]
                quaternion = moving[1]
                linear = moving[6]
                angular = moving[7]

            found += (*position, *quaternion, *linear, *angular)

        return tuple(found)

"""Build and step one PyBullet world with its scene and the robot with a tool."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import combinations
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Tool, ToolJoint
from core.errors import UsageError
from core.geometry import Array, Pose
from core.interfaces import JointTrajectory
from core.robot.description import joint_name
from core.scene import Scene, State
from core.values.robots import Robot
from plugins.simulators.forces import Thing
from plugins.simulators.links import bearers, beyond, friction_of
from plugins.simulators.pybullet.bodies import PreparedBody
from plugins.simulators.pybullet.engine import Client
from plugins.simulators.pybullet.engine import pybullet as p
from plugins.simulators.pybullet.forces import Forces, pushes
from plugins.simulators.pybullet.robot import driven_links, joint_numbers, load_robot
from plugins.simulators.pybullet.trees import Mechanism, Place, prepare_trees

GRAVITY = 9.81
# How far bodies may slide before a stored contact point is dropped, as a share of a shape's radius. PyBullet's default,
# ten times as much, lets stacks creep on outdated points.
_CONTACT_DRIFT = 0.002
_HELD = 1e4  # N m or N, of a motor that holds a joint of the tool
MAX_STEPS = 16  # that are taken in place of one in scenes with stiff joints


class Settings(NamedTuple):
    """The settings of `sim=pybullet`, see there."""

    time_step: float
    solver_iterations: int
    tracking_rate: float
    separation_rate: float


class PreparedScene:
    """A scene ready to be placed in one world after another; files go to ``folder``."""

    def __init__(self, scene: Scene, folder: Path) -> None:
        self.trees = prepare_trees(scene, folder) if scene.joints else []
        self.offsets: dict[str, Pose | None] = {}
        for tree in self.trees:
            self.offsets |= tree.offsets
        self.bodies = [
            PreparedBody.of(body, folder)
            for body in scene.bodies
            if body.collisions and body.name not in self.offsets
        ]
        self.offsets |= {body.name: body.offset for body in self.bodies}
        self.names = tuple(body.name for body in scene.free)
        self.ranks = {body.name: rank for rank, body in enumerate(scene.bodies)}
        self.launched = [body for body in scene.free if body.launched]
        # The free bodies whose frame is not at their centre of mass.
        offsets = enumerate(self.offsets[name] for name in self.names)
        shifted = {i: offset for i, offset in offsets if offset is not None}
        self.shifted = list(shifted)
        self._positions = np.array([offset.position for offset in shifted.values()])
        turns = [offset.rotation.as_quat() for offset in shifted.values()]
        self._rotations = np.reshape(turns, (-1, 4))  # x, y, z, w

    def steps(self, time_step: float) -> int:
        """Count the steps to take in place of one, for joints in a row and stiff ones.

        Raises:
            UsageError: a joint is far too stiff.
        """
        count = 1
        for tree in self.trees:
            in_a_row = 2 if len(tree.dynamics) > 1 else 1
            count = max(count, in_a_row, ceil(tree.rate * time_step))

        if count > MAX_STEPS:
            most = MAX_STEPS / count * time_step
            raise UsageError(
                f"sim=pybullet needs {count} steps in place of one for the scene's stiffest joint, and takes at most "
                f"{MAX_STEPS}; lower its stiffness, damping or latch force, or set sim.time_step to {most:.2g} s"
            )

        return count

    def frames(self, centers: Array, quaternions: Array) -> tuple[Array, Array]:
        """Convert positions (T, K, 3) and quaternions (T, K, 4) of centres of mass to the frames of ``shifted`` bodies.

        The result equals that of `Pose` to the last bit, in a tenth of the time.
        """
        turns = Rotation.from_quat(_unit(quaternions.reshape(-1, 4))[:, [1, 2, 3, 0]])
        matrices = turns.as_matrix().reshape(*centers.shape, 3)
        positions = (matrices @ self._positions[:, :, None])[..., 0] + centers
        offsets = Rotation.from_quat(np.tile(self._rotations, (len(centers), 1)))
        turned = _unit((turns * offsets).as_quat()[:, [3, 0, 1, 2]])
        return positions, turned.reshape(quaternions.shape)


def _unit(quaternions: Array) -> Array:
    """Normalise quaternions (K, 4)."""
    rows = np.ascontiguousarray(quaternions)
    return rows / np.sqrt(rows[:, None, :] @ rows[:, :, None])[:, 0]


class World:
    """A fresh world on ``client``: the robot at the trajectory's first targets, free bodies at their initial poses.

    It is a `core.simulation.playback.BulkWorld` and `Launching`, and a `core.values.jobs.FeelingWorld`.
    """

    def __init__(
        self,
        client: Client,
        scene: PreparedScene,
        robot: Robot,
        file: Path,
        tool: Tool,
        trajectory: JointTrajectory,
        settings: Settings,
        forces: bool = False,
    ) -> None:
        """``file`` describes the robot with ``tool``; with ``forces`` contact forces are summed up."""
        self.client = client
        self._number = client.number
        self.time_step = settings.time_step / scene.steps(settings.time_step)
        self._gain = 1.0 - float(np.exp(-settings.tracking_rate * self.time_step))
        separation = 1.0 - float(np.exp(-settings.separation_rate * self.time_step))
        client.resetSimulation()
        client.setGravity(0.0, 0.0, -GRAVITY)
        client.setPhysicsEngineParameter(
            fixedTimeStep=self.time_step,
            numSolverIterations=settings.solver_iterations,
            numSubSteps=0,
            contactERP=separation,
            contactBreakingThreshold=_CONTACT_DRIFT,
            deterministicOverlappingPairs=1,
        )
        if scene.trees:  # else a joint leaves its limit a fifth as fast as it came
            client.setPhysicsEngineParameter(erp=separation)
        self._scene = scene
        places = {body.name: (body.place(client), -1) for body in scene.bodies}
        for tree in scene.trees:
            places |= tree.place(client, places)
        self._free = [places[name] for name in scene.names]
        self._load_robot(robot, file, tool, trajectory)
        self._places = places
        self._mechanisms = [
            Mechanism(client, tree, places, self._gain, self.time_step)
            for tree in scene.trees
        ]
        self.forces: Forces | None = None
        if forces:
            self.forces = Forces(client, self._things(tool), self.time_step)

    def _load_robot(
        self, robot: Robot, file: Path, tool: Tool, trajectory: JointTrajectory
    ) -> None:
        client = self.client
        self.robot = load_robot(client, file)
        numbers, links = joint_numbers(client, self.robot)
        moving = robot.joints(tool.gripper)
        self._arm = len(robot.arm_joints)
        self._joints = [numbers[name] for name in moving]
        arm = self._joints[: self._arm]
        self._forces = [client.getJointInfo(self.robot, joint)[10] for joint in arm]
        if tool.gripper and robot.gripper is not None:
            self._forces += [robot.gripper.force_n] * len(robot.gripper.joints)
        self._idle_fingers = len(robot.finger_joints)
        self._gains = [self._gain] * len(moving)
        self._velocity_gains = [1.0] * len(moving)
        self._fingers = len(moving) - self._arm
        self._driven: tuple[list[float], list[float]] | None = None
        start = [*trajectory.arm[0], *([trajectory.fingers[0]] * self._fingers)]
        for joint, angle in zip(self._joints, start, strict=True):
            client.resetJointState(self.robot, joint, angle)
        self._links = links
        self._held = (robot, tool)
        self._filter_contacts(robot, tool, links)

        for name, link in links.items():
            friction = np.sqrt(friction_of(robot, tool, name))
            client.changeDynamics(self.robot, link, lateralFriction=friction)

        for name, inertia in driven_links(robot).items():
            moments = inertia.moments.tolist()
            client.changeDynamics(self.robot, links[name], localInertiaDiagonal=moments)

        if tool.bearers:  # Bullet brakes everything that moves, by 4 % in a second
            client.changeDynamics(self.robot, -1, linearDamping=0, angularDamping=0)
        self._loose = [numbers[joint_name(bearer.name)] for bearer in tool.bearers]
        self._noted = [*self._joints, *self._loose]
        held_joints = [bearer.joint for bearer in tool.bearers]
        self._hung = list(zip(self._loose, held_joints, strict=True))
        self._springs: list[tuple[int, ToolJoint]] = []  # once the motion begins
        for number in self._loose:  # held until then
            client.setJointMotorControl2(
                self.robot, number, p.POSITION_CONTROL, targetPosition=0, force=_HELD
            )

    def _filter_contacts(self, robot: Robot, tool: Tool, links: dict[str, int]) -> None:
        """Let a tool touch all links but its bearer. The arm's own links overlap by construction, and never touch."""
        components = {*tool.borne_on}
        joined = [{bearer.name, bearer.parent} for bearer in tool.bearers]
        near = {*bearers(robot, tool)}
        base = self.client.getBodyInfo(self.robot)[0].decode()
        everything = {base: -1, **links}
        for first, second in combinations(everything, 2):
            pair = {first, second}
            at_flange = pair & near and pair & {*tool.mounts}
            touch = bool(pair & components) and not at_flange and pair not in joined
            self.client.setCollisionFilterPair(
                self.robot,
                self.robot,
                everything[first],
                everything[second],
                int(touch),
            )

    def step(
        self, arm: Array, fingers: float, speeds: Array, finger_speed: float
    ) -> None:
        """Drive the joints to targets (J,) and a finger opening, approached at these speeds, for one time step."""
        targets = [*arm.tolist(), *[fingers] * self._fingers]
        velocities = [*speeds.tolist(), *[finger_speed] * self._fingers]
        asked = (targets, velocities)
        if asked != self._driven:  # motors keep their targets
            self._driven = asked
            p.setJointMotorControlArray(  # names would cost half a microsecond a step
                self.robot,
                self._joints,
                p.POSITION_CONTROL,
                targets,
                velocities,
                self._forces,
                self._gains,
                self._velocity_gains,
                self._number,
            )

        for number, spring in self._springs:
            value = self.client.getJointState(self.robot, number)[0]
            torque = spring.stiffness * (spring.rest - value)
            self.client.setJointMotorControl2(
                self.robot, number, p.TORQUE_CONTROL, force=torque
            )

        for mechanism in self._mechanisms:
            mechanism.drive()
        p.stepSimulation(self._number)
        if self.forces:
            self.forces.add_step()

    def pushes(self) -> tuple[Array, Array]:
        return pushes(self.client, self.robot, self._beyond)

    @cached_property
    def _beyond(self) -> set[int]:
        """PyBullet's numbers of what the arm's last joint moves."""
        return {self._links[name] for name in beyond(*self._held) & {*self._links}}

    def launch(self) -> None:
        self._springs = []
        for number, joint in self._hung:
            motor = {"targetVelocity": 0, "force": joint.friction}
            self.client.setJointMotorControl2(  # a motor at rest is dry friction
                self.robot, number, p.VELOCITY_CONTROL, **motor
            )
            if joint.stiffness > 0:
                self._springs.append((number, joint))

        for mechanism in self._mechanisms:
            mechanism.launch()
        for body in self._scene.launched:
            number, _ = self._places[body.name]
            linear = np.array(body.velocity, dtype=np.float64)
            offset = self._scene.offsets[body.name]
            if offset is not None:  # PyBullet takes the velocity of the centre of mass
                _, quaternion = self.client.getBasePositionAndOrientation(number)
                turn = Rotation.from_quat(quaternion).as_matrix()
                linear -= np.cross(body.spin, turn @ offset.position)

            self.client.resetBaseVelocity(number, linear.tolist(), body.spin)

    def _things(self, tool: Tool) -> dict[Place, Thing]:
        """Map all that collides to what contact forces call it."""
        _, links = joint_numbers(self.client, self.robot)
        base = self.client.getBodyInfo(self.robot)[0].decode()
        things: dict[Place, Thing] = {(self.robot, -1): (-1, base)}
        for name, link in links.items():
            shown = "tool" if name in tool.borne_on else name
            things[self.robot, link] = (-1, shown)
        for name, place in self._places.items():
            things[place] = (self._scene.ranks[name], name)
        return things

    def joints(self) -> tuple[Array, Array]:
        """Read the joint positions: arm (J,) and fingers with the tool's joints (F + K,)."""
        arm, fingers = self._joints_of([self._angles()])
        return arm[0], fingers[0]

    def state(self) -> State:
        """Read the state of the free bodies."""
        return self._states_of([self._bodies()])[0]

    def note(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        if self.forces:
            self.forces.note()
        return self._angles(), self._bodies()

    def read(self, notes: Sequence[Any]) -> tuple[Array, Array, State]:
        angles, bodies = zip(*notes, strict=True)
        return *self._joints_of(angles), self._states_of(bodies)

    def _angles(self) -> tuple[float, ...]:
        """The joints' positions; Python's garbage collector soon lets go of tuples of numbers, but not of lists."""
        states = p.getJointStates(self.robot, self._noted, self._number)
        return tuple([state[0] for state in states])

    def _bodies(self) -> tuple[float, ...]:
        """Position, quaternion (x, y, z, w) and velocities of each free body's centre of mass, 13 numbers."""
        found: list[float] = []
        for body, link in self._free:
            if link < 0:
                position, quaternion = p.getBasePositionAndOrientation(
                    body, self._number
                )
                linear, angular = p.getBaseVelocity(body, self._number)
            else:
                moving = self.client.getLinkState(body, link, 1, 1)
                position = moving[0]
                quaternion = moving[1]
                linear = moving[6]
                angular = moving[7]
            found += (*position, *quaternion, *linear, *angular)

        return tuple(found)

    def _joints_of(self, angles: Sequence[tuple[float, ...]]) -> tuple[Array, Array]:
        """Arm (T, J) and fingers with the tool's joints (T, F + K)."""
        rows = np.array(angles)
        count = len(self._joints)
        fingers = np.zeros((len(rows), self._idle_fingers))
        if self._fingers:
            fingers = rows[:, self._arm : count]
        return rows[:, : self._arm], np.concatenate([fingers, rows[:, count:]], axis=1)

    def _states_of(self, bodies: Sequence[tuple[float, ...]]) -> State:
        rows = np.array(bodies, dtype=np.float64)
        rows = rows.reshape(len(bodies), len(self._free), 13)
        positions = rows[..., :3].copy()
        quaternions = rows[..., [6, 3, 4, 5]]
        linear = rows[..., 7:10].copy()
        angular = rows[..., 10:].copy()
        shifted = self._scene.shifted
        if shifted and np.isfinite(quaternions).all():
            centers = positions[:, shifted]
            frames, turns = self._scene.frames(centers, quaternions[:, shifted])
            positions[:, shifted] = frames
            quaternions[:, shifted] = turns
            linear[:, shifted] += np.cross(angular[:, shifted], frames - centers)

        return State(self._scene.names, positions, quaternions, linear, angular)

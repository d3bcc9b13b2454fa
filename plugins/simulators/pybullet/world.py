"""Build and step one PyBullet world with its scene and the robot with a tool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from itertools import combinations
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Tool, ToolJoint
from core.errors import UsageError
from core.geometry import Array
from core.interfaces import JointTrajectory
from core.robot.description import assembled, beyond, joint_name, write
from core.scene import Inertia, Scene, State
from core.values.descriptions import RobotLink
from core.values.robots import Robot
from plugins.simulators.forces import Thing
from plugins.simulators.links import bearers, friction_of, principal
from plugins.simulators.pybullet.bodies import PreparedBody, inertial, text_file
from plugins.simulators.pybullet.engine import Client
from plugins.simulators.pybullet.engine import pybullet as p
from plugins.simulators.pybullet.forces import Forces, pushes
from plugins.simulators.pybullet.trees import Mechanism, Place, prepare_trees

GRAVITY = 9.81
# How far bodies may slide before a stored contact point is dropped, as a share of a shape's radius. PyBullet's default,
# ten times as much, lets stacks creep on outdated points.
_CONTACT_DRIFT = 0.002
_HELD = 1e4  # N m or N, of a motor that holds a joint of the tool
MAX_STEPS = 16  # that are taken in place of one in scenes with stiff joints
# Of no body is a moment of inertia larger than the sum of the two others, and PyBullet reads no such file. A link with
# its motor's inertia is no such body. So files hold these moments, kg m^2, and links get their own once loaded.
_PLACEHOLDER = (1.0, 0.0, 0.0, 1.0, 0.0, 1.0)


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
        hung = {name for tree in self.trees for name in tree.dynamics}
        self.bodies = [
            PreparedBody.of(body, folder)
            for body in scene.bodies
            if body.collisions and body.name not in hung
        ]
        self.names = tuple(body.name for body in scene.free)
        self.ranks = {body.name: rank for rank, body in enumerate(scene.bodies)}
        self.launched = [body for body in scene.free if body.launched]
        self.offsets = {body.name: body.offset for body in self.bodies}
        self.offsets |= {
            name: offset for tree in self.trees for name, offset in tree.offsets.items()
        }
        offsets = [self.offsets[name] for name in self.names]
        shifted = [
            (i, offset) for i, offset in enumerate(offsets) if offset is not None
        ]
        self.shifted = [
            i for i, _ in shifted
        ]  # the free bodies whose frame is not at their centre of mass
        self._positions = np.array([offset.position for _, offset in shifted])
        turns = [offset.rotation.as_quat() for _, offset in shifted]
        self._rotations = np.reshape(turns, (-1, 4))  # x, y, z, w

    def steps(self, time_step: float) -> int:
        """Count the steps to take in place of one, for joints in a row and stiff ones.

        Raises:
            UsageError: a joint is far too stiff.
        """
        in_a_row = 2 if any(len(tree.dynamics) > 1 for tree in self.trees) else 1
        count = max([in_a_row, *(ceil(tree.rate * time_step) for tree in self.trees)])
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
        own = Rotation.from_quat(np.tile(self._rotations, (len(centers), 1)))
        return positions, _unit((turns * own).as_quat()[:, [3, 0, 1, 2]]).reshape(
            quaternions.shape
        )


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
        steps = {
            "fixedTimeStep": self.time_step,
            "numSolverIterations": settings.solver_iterations,
            "numSubSteps": 0,
        }
        contacts = {
            "contactERP": separation,
            "contactBreakingThreshold": _CONTACT_DRIFT,
        }
        client.setPhysicsEngineParameter(
            **steps, **contacts, deterministicOverlappingPairs=1
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
        self.forces = (
            Forces(client, self._things(tool), self.time_step) if forces else None
        )

    def _load_robot(
        self, robot: Robot, file: Path, tool: Tool, trajectory: JointTrajectory
    ) -> None:
        client = self.client
        self.robot = load_robot(client, file)
        numbers, links = joint_numbers(client, self.robot)
        moving = robot.joints(tool.gripper)
        self._arm = len(robot.arm_joints)
        grip = robot.gripper if tool.gripper else None
        self._joints = [numbers[name] for name in moving]
        efforts = [client.getJointInfo(self.robot, joint)[10] for joint in self._joints]
        self._forces = [
            *efforts[: self._arm],
            *([grip.force_n] * len(grip.joints) if grip else ()),
        ]
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
            client.changeDynamics(
                self.robot,
                link,
                lateralFriction=np.sqrt(friction_of(robot, tool, name)),
            )
        for name, inertia in driven_links(robot).items():
            moments = inertia.moments.tolist()
            client.changeDynamics(self.robot, links[name], localInertiaDiagonal=moments)
        if tool.bearers:  # Bullet brakes everything that moves, by 4 % in a second
            client.changeDynamics(self.robot, -1, linearDamping=0, angularDamping=0)
        self._loose = [numbers[joint_name(bearer.name)] for bearer in tool.bearers]
        self._noted = [*self._joints, *self._loose]
        self._hung = [
            *zip(self._loose, (bearer.joint for bearer in tool.bearers), strict=True)
        ]
        self._springs: list[tuple[int, ToolJoint]] = []  # once the motion begins
        for number in self._loose:  # held until then
            client.setJointMotorControl2(
                self.robot, number, p.POSITION_CONTROL, targetPosition=0, force=_HELD
            )

    def _filter_contacts(self, robot: Robot, tool: Tool, links: dict[str, int]) -> None:
        """Let a tool touch all links but its bearer. The arm's own links overlap by construction, and never touch."""
        own = {*tool.borne_on}
        joined = [{bearer.name, bearer.parent} for bearer in tool.bearers]
        near = {*bearers(robot, tool)}
        base = self.client.getBodyInfo(self.robot)[0].decode()
        everything = {base: -1, **links}
        for one, other in combinations(everything, 2):
            pair = {one, other}
            at_flange = pair & near and pair & {*tool.mounts}
            touch = bool(pair & own) and not at_flange and pair not in joined
            self.client.setCollisionFilterPair(
                self.robot, self.robot, everything[one], everything[other], int(touch)
            )

    def step(
        self, arm: Array, fingers: float, speeds: Array, finger_speed: float
    ) -> None:
        """Drive the joints to targets (J,) and a finger opening, approached at these speeds, for one time step."""
        self.obey(
            *self.orders(
                arm[None], np.array([fingers]), speeds[None], np.array([finger_speed])
            )
        )

    def orders(
        self, arm: Array, fingers: Array, speeds: Array, finger_speeds: Array
    ) -> Array:
        asked = [
            [arm, *[fingers] * self._fingers],
            [speeds, *[finger_speeds] * self._fingers],
        ]
        return np.stack([np.column_stack(each) for each in asked], axis=1)

    def obey(self, order: Array) -> None:
        asked = order.tolist()
        if asked != self._driven:  # motors keep their targets
            self._driven = targets, velocities = asked
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
        for number, joint in self._hung:  # a motor at rest is dry friction
            self.client.setJointMotorControl2(
                self.robot,
                number,
                p.VELOCITY_CONTROL,
                targetVelocity=0,
                force=joint.friction,
            )
        self._springs = [
            (number, joint) for number, joint in self._hung if joint.stiffness > 0
        ]
        for mechanism in self._mechanisms:
            mechanism.launch()
        for body in self._scene.launched:
            number, _ = self._places[body.name]
            linear = np.array(body.velocity, dtype=np.float64)
            if offset := self._scene.offsets[
                body.name
            ]:  # PyBullet takes the velocity of the centre of mass
                _, quaternion = self.client.getBasePositionAndOrientation(number)
                linear -= np.cross(
                    body.spin,
                    Rotation.from_quat(quaternion).as_matrix() @ offset.position,
                )
            self.client.resetBaseVelocity(number, linear.tolist(), body.spin)

    def _things(self, tool: Tool) -> dict[Place, Thing]:
        """Map all that collides to what contact forces call it."""
        _, links = joint_numbers(self.client, self.robot)
        own = {
            link: "tool" if name in tool.borne_on else name
            for name, link in links.items()
        }
        own[-1] = self.client.getBodyInfo(self.robot)[0].decode()
        things = {(self.robot, link): (-1, name) for link, name in own.items()}
        return things | {
            place: (self._scene.ranks[name], name)
            for name, place in self._places.items()
        }

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
        return tuple(
            [
                state[0]
                for state in p.getJointStates(self.robot, self._noted, self._number)
            ]
        )

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
        fingers = (
            rows[:, self._arm : count]
            if self._fingers
            else np.zeros((len(rows), self._idle_fingers))
        )
        return rows[:, : self._arm], np.concatenate([fingers, rows[:, count:]], axis=1)

    def _states_of(self, bodies: Sequence[tuple[float, ...]]) -> State:
        rows = np.array(bodies, dtype=np.float64).reshape(
            len(bodies), len(self._free), 13
        )
        positions = rows[..., :3].copy()
        quaternions = rows[..., [6, 3, 4, 5]]
        linear = rows[..., 7:10].copy()
        angular = rows[..., 10:].copy()
        shifted = self._scene.shifted
        if shifted and np.isfinite(quaternions).all():
            centers = positions[:, shifted]
            positions[:, shifted], quaternions[:, shifted] = self._scene.frames(
                centers, quaternions[:, shifted]
            )
            linear[:, shifted] += np.cross(
                angular[:, shifted], positions[:, shifted] - centers
            )
        return State(self._scene.names, positions, quaternions, linear, angular)


def robot_file(folder: Path, robot: Robot, tool: Tool, *, visuals: bool) -> Path:
    """Write the arm with its tool to a file: PyBullet reads only files."""
    arm = assembled(robot, tool, fused=True)
    held = dict[str, RobotLink]()
    for name, inertia in driven_links(robot).items():
        held[name] = replace(
            arm.links[name], inertial=replace(inertial(inertia), moments=_PLACEHOLDER)
        )
    return text_file(
        folder, write(replace(arm, links=arm.links | held), visuals=visuals), "urdf"
    )


@lru_cache(maxsize=8)
def driven_links(robot: Robot) -> dict[str, Inertia]:
    """Map each link that a motor turns to its inertia with the motor's, which is about the joint's axis alone.

    Bullet has no inertia of a joint. As a link's own, the joints before it carry it too where their axes are parallel.
    """
    arm = assembled(robot, fused=True)
    inertias = {}
    for name, motor in zip(robot.arm_joints, robot.motor_inertia, strict=True):
        joint = arm.named[name]
        mass, center, tensor = arm.links[joint.child].inertial.placed()
        inertias[joint.child] = principal(
            mass, center, tensor + motor * np.outer(joint.axis, joint.axis)
        )
    return inertias


def load_robot(client: Client, file: Path) -> int:
    """Load the arm and return its number in the world."""
    flags = p.URDF_USE_INERTIA_FROM_FILE | p.URDF_USE_SELF_COLLISION
    return int(client.loadURDF(str(file), useFixedBase=True, flags=flags))


def joint_numbers(client: Client, robot: int) -> tuple[dict[str, int], dict[str, int]]:
    """Map the names of joints, and of links but the base, to PyBullet's numbers."""
    joints = {}
    links = {}
    for number in range(client.getNumJoints(robot)):
        info = client.getJointInfo(robot, number)
        joints[info[1].decode()] = number
        links[info[12].decode()] = number
    return joints, links

"""One PyBullet world: the scene, the robot with a tool, and steps."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Tool
from core.geometry import Array, Pose
from core.interfaces import JointTrajectory
from core.robot import ARM_JOINTS, FINGER_FRICTION, FINGER_JOINTS, GRIP_FORCE, TOOL_FRICTION, assemble
from core.scene import Body, Scene, State
from plugins.simulators.pybullet.bodies import body_urdf
from plugins.simulators.pybullet.engine import pybullet as p

GRAVITY = 9.81
_CONTACT_DRIFT = 0.002  # share of a shape's radius by which the bodies may have slid before a kept contact point is
# dropped; PyBullet's own, ten times as much, lets stacks creep: the points they stand on are out of date


class World:
    """A fresh world on ``client``, the robot at the trajectory's first targets; free bodies at their places."""

    def __init__(
        self,
        client: int,
        folder: Path,
        scene: Scene,
        tool: Tool,
        trajectory: JointTrajectory,
        *,
        time_step: float,
        solver_iterations: int,
        tracking_rate: float,
        separation_rate: float,
    ) -> None:
        self.client = client
        self.time_step = time_step
        self._gain = 1.0 - float(np.exp(-tracking_rate * time_step))
        p.resetSimulation(physicsClientId=client)
        p.setGravity(0.0, 0.0, -GRAVITY, physicsClientId=client)
        p.setPhysicsEngineParameter(
            fixedTimeStep=time_step,
            numSolverIterations=solver_iterations,
            numSubSteps=0,
            contactERP=1.0 - float(np.exp(-separation_rate * time_step)),
            contactBreakingThreshold=_CONTACT_DRIFT,
            deterministicOverlappingPairs=1,
            physicsClientId=client,
        )
        self._names = tuple(body.name for body in scene.free)
        self._bodies: list[tuple[int, Pose | None]] = []  # the body's frame in PyBullet's, which is its centre of mass
        for body in scene.bodies:
            if body.collisions:
                number, offset = add_body(client, folder, body)
                if not body.fixed:
                    self._bodies.append((number, offset))
        self._load_robot(folder, tool, trajectory)

    def _load_robot(self, folder: Path, tool: Tool, trajectory: JointTrajectory) -> None:
        client = self.client
        self.robot = load_robot(client, folder, tool, visuals=False)
        numbers, links = joint_numbers(client, self.robot)
        moving = [*ARM_JOINTS, *(FINGER_JOINTS if tool.gripper else ())]
        self._joints = [numbers[name] for name in moving]
        self._forces = [
            GRIP_FORCE
            if name in FINGER_JOINTS
            else p.getJointInfo(self.robot, numbers[name], physicsClientId=client)[10]
            for name in moving
        ]
        self._gains = [self._gain] * len(moving)
        self._velocity_gains = [1.0] * len(moving)
        self._gripper = tool.gripper
        start = [*trajectory.arm[0], *([trajectory.fingers[0]] * 2 if tool.gripper else ())]
        for joint, angle in zip(self._joints, start, strict=True):
            p.resetJointState(self.robot, joint, angle, physicsClientId=client)
        self._filter_contacts(tool, links)
        for name, link in links.items():
            friction = FINGER_FRICTION if name in GRIPPER_MOUNTS else TOOL_FRICTION
            p.changeDynamics(self.robot, link, lateralFriction=np.sqrt(friction), physicsClientId=client)

    def _filter_contacts(self, tool: Tool, links: dict[str, int]) -> None:
        """The arm's own links overlap by construction and never touch each other; what is mounted touches all but its
        bearer.
        """
        mounts = set(GRIPPER_MOUNTS) if tool.gripper else {RIGID_MOUNT}
        bearers = {"panda_hand"} if tool.gripper else {"panda_link7", "panda_link8"}
        everything = {"panda_link0": -1, **links}
        names = list(everything)
        for i, one in enumerate(names):
            for other in names[i + 1 :]:
                touch = bool({one, other} & mounts) and not {one, other} & bearers
                p.setCollisionFilterPair(
                    self.robot, self.robot, everything[one], everything[other], int(touch), physicsClientId=self.client
                )

    def step(self, arm: Array, fingers: float, speeds: Array, finger_speed: float) -> None:
        """Drive the joints toward targets (7,) and a finger opening, which they approach at these speeds; then one
        time step.
        """
        targets, velocities = arm.tolist(), speeds.tolist()
        if self._gripper:
            targets += [fingers, fingers]
            velocities += [finger_speed, finger_speed]
        p.setJointMotorControlArray(
            self.robot,
            self._joints,
            p.POSITION_CONTROL,
            targetPositions=targets,
            targetVelocities=velocities,
            forces=self._forces,
            positionGains=self._gains,
            velocityGains=self._velocity_gains,
            physicsClientId=self.client,
        )
        p.stepSimulation(physicsClientId=self.client)

    def joints(self) -> tuple[Array, Array]:
        """Arm (7,) and fingers (2,) as they are."""
        angles = np.array([s[0] for s in p.getJointStates(self.robot, self._joints, physicsClientId=self.client)])
        return angles[:7], angles[7:] if self._gripper else np.zeros(2)

    def state(self) -> State:
        """Of the free bodies."""
        count = len(self._bodies)
        positions, quaternions = np.empty((count, 3)), np.empty((count, 4))
        linear, angular = np.empty((count, 3)), np.empty((count, 3))
        for i, (body, offset) in enumerate(self._bodies):
            center, (x, y, z, w) = p.getBasePositionAndOrientation(body, physicsClientId=self.client)
            linear[i], angular[i] = p.getBaseVelocity(body, physicsClientId=self.client)
            positions[i], quaternions[i] = center, (w, x, y, z)
            if offset is not None and np.isfinite(quaternions[i]).all():
                frame = Pose(np.array(center), quaternions[i]) @ offset
                linear[i] += np.cross(angular[i], frame.position - center)
                positions[i], quaternions[i] = frame.position, frame.quaternion
        return State(self._names, positions, quaternions, linear, angular)


def load_robot(client: int, folder: Path, tool: Tool, *, visuals: bool) -> int:
    """Load the arm with its tool; PyBullet reads files only, so the text goes to ``folder`` first."""
    file = _file(folder, assemble(tool, fused=True, visuals=visuals))
    flags = p.URDF_USE_INERTIA_FROM_FILE | p.URDF_USE_SELF_COLLISION
    return int(p.loadURDF(str(file), useFixedBase=True, flags=flags, physicsClientId=client))


def add_body(client: int, folder: Path, body: Body) -> tuple[int, Pose | None]:
    """Place a body. Returns its number, and its frame in the frame of its centre of mass, None where they are the
    same.
    """
    inertia = None if body.fixed else body.inertia()
    x, y, z, w = body.pose.rotation.as_quat()
    number = p.loadURDF(
        str(_file(folder, body_urdf(body, inertia, folder))),
        basePosition=body.pose.position.tolist(),
        baseOrientation=[x, y, z, w],
        useFixedBase=body.fixed,
        flags=p.URDF_USE_INERTIA_FROM_FILE | p.URDF_USE_IMPLICIT_CYLINDER,
        physicsClientId=client,
    )
    p.changeDynamics(
        number,
        -1,
        lateralFriction=np.sqrt(body.friction),  # PyBullet multiplies the two bodies'; ours is their geometric mean
        rollingFriction=body.rolling_friction / np.sqrt(0.5),  # multiplied by the other's lateral one: 0.5, mostly
        restitution=body.restitution,
        linearDamping=0.0,
        angularDamping=0.0,
        physicsClientId=client,
    )
    same = inertia is None or inertia.frame == Pose()
    return int(number), None if inertia is None or same else inertia.frame.inverse()


def _file(folder: Path, text: str) -> Path:
    file = folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.urdf"
    if not file.exists():
        file.write_text(text)
    return file


def joint_numbers(client: int, robot: int) -> tuple[dict[str, int], dict[str, int]]:
    """PyBullet's number of each joint, and of each link but the base, by name."""
    joints, links = {}, {}
    for number in range(p.getNumJoints(robot, physicsClientId=client)):
        info = p.getJointInfo(robot, number, physicsClientId=client)
        joints[info[1].decode()] = number
        links[info[12].decode()] = number
    return joints, links

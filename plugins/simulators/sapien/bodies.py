"""Put a scene's bodies into PhysX."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from core.geometry import Cylinder
from core.scene import Body, Joint, Scene, State
from core.values.joints import rotate
from plugins.simulators.inertia import ROTOR, Inertia, inertia_of, principal
from plugins.simulators.rolling import rollers
from plugins.simulators.sapien.brakes import Brake, Brakes
from plugins.simulators.sapien.engine import physx
from plugins.simulators.sapien.mechanisms import apart
from plugins.simulators.sapien.shapes import PlacedShape, Setup, attach, to_sapien
from plugins.simulators.sapien.surfaces import TOGETHER, Surface

# How fast overlapping bodies are pushed apart, m/s at most. It also bounds the force that a light body transmits: its
# mass times this in each of the solver's iterations, 40 N for 10 g. Twice as much pushes a rod through a thin wall.
_SEPARATION = 2.0
# The least arm of rolling friction of a lying cylinder, as a share of its radius: where it rests and where it rolls.
# Without, it begins to roll by itself.
_LEAST_RESTING = 0.02
_LEAST_ROLLING = 0.01
# Seconds between two updates of the normal force on a rolling body.
_BRAKE_EVERY = 0.02

Floats = npt.NDArray[np.float32]


class Weighed:
    """A scene with what is slow to compute of its free bodies.

    Attributes:
        scene: the scene.
        inertias: of the free bodies, by name.
        radii: of each body that lies on cylinders, metres; of several the largest.
        moving: the surfaces of free bodies.
        fixed: those of fixed bodies.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.inertias = {body.name: inertia_of(body) for body in scene.free}
        for joint in scene.joints:
            if joint.drive is not None and joint.kind == "hinge":
                moved = self.inertias[joint.body]
                self.inertias[joint.body] = _with_rotor(moved, joint)

        self.radii: dict[str, float] = {}
        for body in scene.free:
            lying = [shape for shape in rollers(body) if isinstance(shape, Cylinder)]
            if lying:
                self.radii[body.name] = max(shape.radius for shape in lying)

        self.moving = {Surface.of(body) for body in scene.free}
        fixed = [body for body in scene.bodies if body.fixed and body.collisions]
        self.fixed = {Surface.of(body) for body in fixed}


def _with_rotor(inertia: Inertia, joint: Joint) -> Inertia:
    """Return the inertia of a body with the rotor of its joint's drive, about the joint's axis.

    The solver sees a body turn about its centre of mass. A light one would give way to its load, however stiff its
    drive is.
    """
    turn = inertia.frame.rotation.as_matrix()
    tensor = turn @ np.diag(inertia.moments) @ turn.T
    force = 0.0 if joint.drive is None else joint.drive.force
    rotor = ROTOR * force * np.outer(joint.axis, joint.axis)
    return principal(inertia.mass, inertia.frame.position, tensor + rotor)


def weigh(component: Any, inertia: Inertia) -> None:
    """Set the mass of a link or a free body, and switch PhysX's damping off."""
    component.mass = inertia.mass
    component.inertia = inertia.moments
    component.cmass_local_pose = to_sapien(inertia.frame)
    component.linear_damping = 0.0
    component.angular_damping = 0.0
    component.max_depenetration_velocity = _SEPARATION


class Bodies:
    """The bodies of a scene, at their initial poses.

    Call `end_step` after each step, and `launch` once, when the robot's motion begins.

    Args:
        setup: of the world.
        weighed: the scene.

    Attributes:
        components: PhysX's of the free bodies, by name.
    """

    def __init__(self, setup: Setup, weighed: Weighed) -> None:
        scene = weighed.scene
        self._setup = setup
        self._weighed = weighed
        self._names = tuple(body.name for body in scene.free)
        self._system = setup.scene.physx_system
        self._launched = [body for body in scene.free if body.launched]
        self.components: dict[str, Any] = {}

        # Bodies whose frame is not at their centre of mass.
        positions = [weighed.inertias[name].frame.position for name in self._names]
        centers = np.array(positions).reshape(-1, 3)
        self._shifted = np.flatnonzero(centers.any(axis=1))
        self._centers = centers[self._shifted]

        brakes: list[Brake] = []
        joined = apart(scene)
        for rank, body in enumerate(scene.bodies):
            if not body.collisions:
                continue

            component = physx.PhysxRigidStaticComponent()
            drive = None
            if not body.fixed:
                component = physx.PhysxRigidDynamicComponent()
                weigh(component, weighed.inertias[body.name])
                self.components[body.name] = component
                brake = self._make_brake(body, component)
                if brake is not None:
                    brakes.append(brake)
                    drive = brake.drive

            for part in body.collisions:
                attach(
                    setup,
                    component,
                    PlacedShape(part.shape, part.pose, body.name),
                    (rank, body.name),
                    Surface.of(body),
                    joined.get(body.name, TOGETHER),
                    fixed=body.fixed,
                )

            setup.add(
                body.name,
                component,
                body.pose,
                drive,
            )

        self._steps = 0
        self._brake_every = 0
        if brakes:
            self._brake_every = max(1, round(_BRAKE_EVERY / setup.time_step))

        seconds = self._brake_every * setup.time_step
        self._brakes = Brakes(brakes, seconds, weighed.scene.gravity)

    def _make_brake(self, body: Body, component: Any) -> Brake | None:
        """Make the brake of a free body; None: it has no rolling friction."""
        radius = self._weighed.radii.get(body.name, 0.0)
        arm = max(body.rolling_friction, _LEAST_ROLLING * radius)
        if arm <= 0:
            return None

        drive = physx.PhysxDriveComponent(component)
        impulse = arm * body.mass * self._setup.time_step
        held = max(1.0, _LEAST_RESTING * radius / arm)
        return Brake(
            self._names.index(body.name),
            drive,
            impulse,
            held,
        )

    @property
    def brake(self) -> bool:
        """Whether any has rolling friction."""
        return self._brake_every > 0

    def end_step(self) -> None:
        """Update the brakes; call it after each time step, where bodies ``brake``."""
        self._steps += 1
        if self._steps % self._brake_every == 0:
            size = 13 * len(self._names)
            bodies = np.frombuffer(self.snapshot(), np.float32, size).reshape(-1, 13)
            self._brakes.adjust(bodies[:, 7:10])

    def launch(self) -> None:
        """Give bodies their velocities; PhysX takes that of the centre of mass."""
        for body in self._launched:
            component = self.components[body.name]
            spin = np.asarray(body.spin)
            there = component.entity_pose
            arm = (there * component.cmass_local_pose).p - there.p
            component.linear_velocity = body.velocity + np.cross(spin, arm)
            component.angular_velocity = spin

    def snapshot(self) -> bytes:
        """Take a snapshot of the whole scene in one call: reading figures one by one takes 200 times as long."""
        packed: bytes = self._system.pack()
        return packed

    def read(self, notes: Sequence[bytes]) -> State:
        """Decode T snapshots of the free bodies.

        SAPIEN packs 13 single-precision numbers of each body, the free ones first, and 13 more behind them. Then come
        the robot's joints.
        """
        numbers = self._unpack(notes).astype(np.float64)
        quaternions, positions, linear, angular = np.split(numbers, [4, 7, 10], axis=2)
        squares = (quaternions * quaternions).sum(axis=2, keepdims=True)
        quaternions /= np.sqrt(squares)  # single precision until here

        if len(self._shifted):  # PhysX reports the velocity of the centre of mass
            arms = rotate(quaternions[:, self._shifted], self._centers)
            linear[:, self._shifted] -= np.cross(angular[:, self._shifted], arms)

        return State(
            self._names,
            positions,
            quaternions,
            linear,
            angular,
        )

    def _unpack(self, notes: Sequence[bytes]) -> Floats:
        """Decode each free body's quaternion, position, linear and angular velocity, (T, B, 13)."""
        count = len(self._names)
        return _floats(notes)[:, : 13 * count].reshape(len(notes), count, 13)

    def behind(self, notes: Sequence[bytes]) -> Floats:
        """Decode what comes behind the bodies, (T, N): the robot's joints, and their speeds and forces."""
        return _floats(notes)[:, 13 * len(self._names) + 13 :]


def _floats(notes: Sequence[bytes]) -> Floats:
    """Decode snapshots (T, N)."""
    return np.frombuffer(b"".join(notes), dtype=np.float32).reshape(len(notes), -1)

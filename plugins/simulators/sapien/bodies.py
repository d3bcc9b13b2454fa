"""Put a scene's bodies into PhysX."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from core.geometry import Cylinder
from core.scene import Scene, State
from core.values.joints import rotate
from plugins.simulators.inertia import Inertia, inertia_of
from plugins.simulators.rolling import rollers
from plugins.simulators.sapien.engine import physx, sapien
from plugins.simulators.sapien.joints import apart
from plugins.simulators.sapien.shapes import collision, place, to_sapien
from plugins.simulators.sapien.surfaces import Surface, Surfaces

GRAVITY = 9.81

# How fast overlapping bodies are pushed apart, m/s at most. It also bounds the force that a light body transmits: its
# mass times this in each of the solver's iterations, 40 N for 10 g. Twice as much pushes a rod through a thin wall.
_SEPARATION = 2.0
# How fast rolling is stopped, up to the brake's torque, 1/s: at once.
_BRAKE = 1e4
# The least arm of rolling friction of a lying cylinder, as a share of its radius: where it rests, slower than so many
# m/s, and where it rolls. Without, it begins to roll by itself.
_LEAST_RESTING = 0.02
_LEAST_ROLLING = 0.01
_RESTS = 0.05
# Seconds between two updates of the normal force on a rolling body.
_BRAKE_EVERY = 0.02
_ALIKE = (0.98, 1.02)  # a brake is updated if the force changed by more than these
_UP = np.array([0.0, 0.0, GRAVITY], dtype=np.float32)
UNKNOWN_PACK = "this version of SAPIEN packs states in another way than 3.0.3: pip install sapien==3.0.3"


@dataclass(frozen=True, eq=False)
class Weighed:
    """A scene with the inertias of its free bodies, which are slow to compute."""

    scene: Scene

    @cached_property
    def inertias(self) -> dict[str, Inertia]:
        return {body.name: inertia_of(body) for body in self.scene.free}

    @cached_property
    def radii(self) -> dict[str, float]:
        """The radius of each body that lies on cylinders, metres; of several the largest."""
        found = {}
        for body in self.scene.free:
            lying = [shape for shape in rollers(body) if isinstance(shape, Cylinder)]
            if lying:
                found[body.name] = max(shape.radius for shape in lying)
        return found

    @cached_property
    def moving(self) -> set[Surface]:
        return {Surface.of(body) for body in self.scene.free}

    @cached_property
    def fixed(self) -> set[Surface]:
        return {
            Surface.of(body)
            for body in self.scene.bodies
            if body.fixed and body.collisions
        }


def weigh(component: Any, inertia: Inertia) -> None:
    """Set the mass of a link or a free body, and switch PhysX's damping off."""
    component.mass = inertia.mass
    component.inertia = inertia.moments
    component.cmass_local_pose = to_sapien(inertia.frame)
    component.linear_damping = 0.0
    component.angular_damping = 0.0
    component.max_depenetration_velocity = _SEPARATION


class Bodies:
    """The bodies of a scene, at their initial poses."""

    def __init__(
        self,
        scene: Any,
        surfaces: Surfaces,
        weighed: Weighed,
        folder: Path,
        time_step: float,
    ) -> None:
        self._names = tuple(body.name for body in weighed.scene.free)
        self._system = scene.physx_system
        positions = [weighed.inertias[name].frame.position for name in self._names]
        centers = np.array(positions).reshape(-1, 3)
        # Bodies whose frame is not at their centre of mass.
        self._shifted = np.flatnonzero(centers.any(axis=1))
        self._centers = centers[self._shifted]
        brakes: list[_Brake] = []
        self._brake_every = max(1, round(_BRAKE_EVERY / time_step))
        self._steps = 0
        self.components: dict[str, Any] = {}  # of the free bodies
        self._launched = [body for body in weighed.scene.free if body.launched]
        joined = apart(weighed.scene)
        for body in weighed.scene.bodies:
            if not body.collisions:
                continue
            if body.fixed:
                component = physx.PhysxRigidStaticComponent()
            else:
                component = physx.PhysxRigidDynamicComponent()
                weigh(component, weighed.inertias[body.name])
                self.components[body.name] = component

            entity = sapien.Entity()
            entity.name = body.name
            entity.add_component(component)

            mechanism, bits = joined.get(body.name, (0, 0))
            for part in body.collisions:
                make = partial(collision, part.shape, folder=folder)
                copies = surfaces.copies(
                    Surface.of(body),
                    make,
                    fixed=body.fixed,
                    apart=bits,
                    mechanism=mechanism,
                )
                for shape in copies:
                    place(shape, part.shape, part.pose)
                    component.attach(shape)

            entity.pose = to_sapien(body.pose)

            radius = weighed.radii.get(body.name, 0.0)
            arm = max(body.rolling_friction, _LEAST_ROLLING * radius)
            if not body.fixed and arm > 0:
                drive = physx.PhysxDriveComponent(component)
                impulse = arm * body.mass * time_step
                held = max(1.0, _LEAST_RESTING * radius / arm)
                _limit(drive, impulse, held * GRAVITY)
                entity.add_component(drive)
                number = self._names.index(body.name)
                brakes.append(_Brake(number, drive, impulse, held))

            scene.add_entity(entity)

        self._brakes = _Brakes(brakes, self._brake_every * time_step)
        placed = weighed.scene.state()
        packed = self._numbers([self.note()])[0, :, :7]
        expected = np.hstack([placed.quaternions, placed.positions])
        if not np.allclose(packed, expected, atol=1e-5):
            raise RuntimeError(UNKNOWN_PACK)

    def stepped(self) -> None:
        """Update the brakes; call it after each time step."""
        self._steps += 1
        if self._brakes.brakes and self._steps % self._brake_every == 0:
            self._brakes.adjust(self._numbers([self.note()])[0, :, 7:10])

    def launch(self) -> None:
        """Give bodies their velocities; PhysX takes that of the centre of mass."""
        for body in self._launched:
            component = self.components[body.name]
            spin = np.asarray(body.spin)
            there = component.entity_pose
            arm = (there * component.cmass_local_pose).p - there.p
            component.linear_velocity = body.velocity + np.cross(spin, arm)
            component.angular_velocity = spin

    def state(self) -> State:
        """Read the state of the free bodies."""
        return self.read([self.note()])[0]

    def note(self) -> bytes:
        """Take a snapshot of the whole scene in one call: reading figures one by one takes 200 times as long."""
        noted: bytes = self._system.pack()
        return noted

    def read(self, notes: Sequence[bytes]) -> State:
        """Decode T snapshots of the free bodies."""
        numbers = self._numbers(notes).astype(np.float64)
        quaternions, positions, linear, angular = np.split(numbers, [4, 7, 10], axis=2)
        squares = (quaternions * quaternions).sum(axis=2, keepdims=True)
        quaternions /= np.sqrt(squares)  # single precision until here
        if len(self._shifted):  # PhysX reports the velocity of the centre of mass
            arms = rotate(quaternions[:, self._shifted], self._centers)
            linear[:, self._shifted] -= np.cross(angular[:, self._shifted], arms)
        return State(self._names, positions, quaternions, linear, angular)

    def _numbers(self, notes: Sequence[bytes]) -> npt.NDArray[np.float32]:
        """Decode each free body's quaternion, position, linear and angular velocity, (T, B, 13)."""
        count = len(self._names)
        return _floats(notes)[:, : 13 * count].reshape(len(notes), count, 13)

    def behind(self, notes: Sequence[bytes]) -> npt.NDArray[np.float32]:
        """Decode what comes behind the bodies, (T, N): the robot's joints, and their speeds and forces."""
        return _floats(notes)[:, 13 * len(self._names) + 13 :]


def _floats(notes: Sequence[bytes]) -> npt.NDArray[np.float32]:
    return np.frombuffer(b"".join(notes), dtype=np.float32).reshape(len(notes), -1)


def _limit(drive: Any, impulse: float, acceleration: float) -> None:
    """Limit a brake's torque, for a normal force of the body's mass times ``acceleration``."""
    drive.set_drive_property_slerp(0.0, _BRAKE, impulse * acceleration, "acceleration")


class _Brake(NamedTuple):
    """A drive that stops the rotation of a free body.

    Attributes:
        number: the body's.
        drive: SAPIEN's.
        impulse: the drive's, per step and m/s^2.
        held: how many times as much it is where the body rests.
    """

    number: int
    drive: Any
    impulse: float
    held: float


class _Brakes:
    """Rolling friction, which PhysX lacks.

    A brake's torque is at most the arm of rolling friction times the normal force, which is taken to be what makes the
    body deviate from free fall. Two adjustments are ``seconds`` apart.
    """

    def __init__(self, brakes: list[_Brake], seconds: float) -> None:
        self.brakes = brakes
        self._numbers = [brake.number for brake in brakes]
        held = [brake.held * brake.held for brake in brakes]
        self._held = np.array(held, dtype=np.float32)
        self._seconds = seconds
        still = np.zeros((len(brakes), 3), dtype=np.float32)
        self._velocities: npt.NDArray[np.float32] = still
        # Squares of the accelerations between which a brake may stay as it is.
        self._low = (_ALIKE[0] * GRAVITY) ** 2 * self._held
        self._high = (_ALIKE[1] * GRAVITY) ** 2 * self._held

    def adjust(self, velocities: npt.NDArray[np.float32]) -> None:
        """Update the brakes from the velocities (B, 3) of all free bodies."""
        braked = velocities.take(self._numbers, axis=0)
        contact = (braked - self._velocities) / self._seconds + _UP
        self._velocities = braked
        squares = np.einsum("bi,bi->b", contact, contact)
        resting = np.einsum("bi,bi->b", braked, braked) < _RESTS**2
        squares *= np.where(resting, self._held, 1)

        changed = ((squares < self._low) | (squares > self._high)).nonzero()[0]
        if not len(changed):
            return
        changed_to = np.sqrt(squares[changed])
        for number, acceleration in zip(
            changed.tolist(), changed_to.tolist(), strict=True
        ):
            brake = self.brakes[number]
            _limit(brake.drive, brake.impulse, acceleration)

        self._low[changed] = (_ALIKE[0] * changed_to) ** 2
        self._high[changed] = (_ALIKE[1] * changed_to) ** 2

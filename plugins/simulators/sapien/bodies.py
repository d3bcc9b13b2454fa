"""A scene's bodies as PhysX has them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from core.geometry import Array
from core.scene import Body, Inertia, Part, Scene, State
from plugins.simulators.sapien.engine import physx, sapien
from plugins.simulators.sapien.shapes import collision, to_sapien
from plugins.simulators.sapien.surfaces import Surface, Surfaces

GRAVITY = 9.81

# How fast overlapping bodies are pushed apart, m/s at most. It also bounds the force that goes through a light body, to
# its mass times this in each of the solver's iterations, 40 N through 10 g. Twice it pushes a rod through a thin wall.
_SEPARATION = 2.0
# How strongly rolling is slowed down until its torque is reached, 1/s: at once.
_BRAKE = 1e4
# Seconds between two looks at how hard a rolling body is pressed on.
_BRAKE_EVERY = 0.02


@dataclass(frozen=True, eq=False)
class Weighed:
    """A scene, with the inertias of its free bodies, which take their time to be computed."""

    scene: Scene

    @cached_property
    def inertias(self) -> dict[str, Inertia]:
        return {body.name: body.inertia() for body in self.scene.free}

    @cached_property
    def moving(self) -> set[Surface]:
        return {Surface.of(body) for body in self.scene.free}

    @cached_property
    def fixed(self) -> set[Surface]:
        return {Surface.of(body) for body in self.scene.bodies if body.fixed and body.collisions}


def weigh(component: Any, inertia: Inertia) -> None:
    """Give a link or a free body its mass, and take away what PhysX would slow it down with."""
    component.mass = inertia.mass
    component.inertia = inertia.moments
    component.cmass_local_pose = to_sapien(inertia.frame)
    component.linear_damping = 0.0
    component.angular_damping = 0.0
    component.max_depenetration_velocity = _SEPARATION


class Bodies:
    """The bodies of a scene, at their places."""

    def __init__(self, scene: Any, surfaces: Surfaces, weighed: Weighed, folder: Path, time_step: float) -> None:
        self._names = tuple(body.name for body in weighed.scene.free)
        self._system = scene.physx_system
        self._centers = np.array([weighed.inertias[name].frame.position for name in self._names]).reshape(-1, 3)
        self._brakes: list[_Brake] = []
        self._brake_every = max(1, round(_BRAKE_EVERY / time_step))
        self._steps = 0
        for body in weighed.scene.bodies:
            if not body.collisions:
                continue
            component = physx.PhysxRigidStaticComponent() if body.fixed else physx.PhysxRigidDynamicComponent()
            entity = sapien.Entity()
            entity.name = body.name
            entity.add_component(component)
            if not body.fixed:
                weigh(component, weighed.inertias[body.name])
            for part in body.collisions:
                _attach(component, body, part, surfaces, folder)
            entity.pose = to_sapien(body.pose)
            if not body.fixed and body.rolling_friction > 0:
                self._brakes.append(_Brake(entity, component, body, time_step, self._brake_every))
            scene.add_entity(entity)
        placed = weighed.scene.state()
        told = self._numbers()[:, :7]
        if not np.allclose(told, np.hstack([placed.quaternions, placed.positions]), atol=1e-5):
            raise RuntimeError("this version of SAPIEN packs states in another way than 3.0.3")

    def stepped(self) -> None:
        """To be called after each time step."""
        self._steps += 1
        if self._brakes and self._steps % self._brake_every == 0:
            for brake in self._brakes:
                brake.adjust()

    def state(self) -> State:
        """Of the free bodies."""
        numbers = self._numbers()
        quaternions, positions, linear, angular = np.split(numbers, (4, 7, 10), axis=-1)
        quaternions = quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)  # single precision until here
        # PhysX tells the velocity of the centre of mass.
        w, along = quaternions[:, :1], quaternions[:, 1:]
        arms = self._centers + 2 * np.cross(along, np.cross(along, self._centers) + w * self._centers)
        return State(self._names, positions, quaternions, linear - np.cross(angular, arms), angular)

    def _numbers(self) -> Array:
        """Of each free body the quaternion, position, linear and angular velocity, all in one call: asking each for
        each takes two hundred times as long.
        """
        count = len(self._names)
        packed = np.frombuffer(self._system.pack(), dtype=np.float32, count=13 * count)
        return packed.reshape(count, 13).astype(np.float64)


class _Brake:
    """Rolling friction, which PhysX does not know: a drive that stops a body's turning with the torque of its arm times
    the force that presses on it, at most.

    The force is taken to be what makes the body move otherwise than in free fall.
    """

    def __init__(self, entity: Any, component: Any, body: Body, time_step: float, every: int) -> None:
        self._component = component
        self._drive = physx.PhysxDriveComponent(component)
        self._impulse = body.rolling_friction * body.mass * time_step  # of the drive, per step and m/s^2
        self._seconds = every * time_step
        self._velocity = np.zeros(3)
        self._set(GRAVITY)
        entity.add_component(self._drive)

    def _set(self, acceleration: float) -> None:
        self._acceleration = acceleration
        self._drive.set_drive_property_slerp(0.0, _BRAKE, self._impulse * acceleration, "acceleration")

    def adjust(self) -> None:
        velocity = self._component.linear_velocity
        change = (velocity - self._velocity) / self._seconds
        self._velocity = velocity
        acceleration = float(np.hypot(np.hypot(change[0], change[1]), change[2] + GRAVITY))
        if abs(acceleration - self._acceleration) > 0.02 * self._acceleration:
            self._set(acceleration)


def _attach(component: Any, body: Body, part: Part, surfaces: Surfaces, folder: Path) -> None:
    for shape in surfaces.copies(Surface.of(body), lambda m: collision(part.shape, m, folder), fixed=body.fixed):
        shape.local_pose = to_sapien(part.pose)
        component.attach(shape)

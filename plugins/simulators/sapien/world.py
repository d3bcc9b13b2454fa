"""Build and step one PhysX scene with its bodies and the robot with a tool."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from core.geometry import Array, Vector
from core.interfaces import Order, Robot, Rollout
from core.robot.description import beyond
from core.scene import State
from plugins.simulators.fresh import FreshWorld
from plugins.simulators.sapien.arm import ArticulatedArm, TorqueNote, surfaces_of
from plugins.simulators.sapien.bodies import Bodies, Weighed
from plugins.simulators.sapien.bonds import Bonds
from plugins.simulators.sapien.engine import physx, sapien
from plugins.simulators.sapien.forces import Forces, pushes
from plugins.simulators.sapien.grips import Grips
from plugins.simulators.sapien.mechanisms import Joints
from plugins.simulators.sapien.shapes import Setup
from plugins.simulators.sapien.surfaces import Surfaces

# Contacts begin at this distance, metres: bodies are slowed down before they penetrate.
_CONTACT_OFFSET = 0.001
# Slower impacts don't bounce, m/s.
_BOUNCE = 0.2
# A body sleeps if its kinetic energy per mass, (m/s)^2 / 2, stays below this for 0.4 s: 3 mm/s.
_SLEEP = 5e-6


class Settings(NamedTuple):
    """Settings of `sim=sapien`, see there."""

    solver_iterations: int
    tracking_rate: float


class World(FreshWorld):
    """The robot at a trajectory's first targets, and free bodies at their initial poses.

    PhysX does not tell friction, so `pushes` are without it.

    Attributes:
        bonds: those of the scene; None: it has none.

    Args:
        weighed: the scene.
        robot: the arm.
        job: says the tool and the motion, and if forces are measured.
        folder: for files of meshes.
        time_step: seconds.
        settings: of the engine.
    """

    bonds: Bonds | None = None
    _before = (
        b""  # the snapshot before the last step; empty: there was none since the launch
    )

    def __init__(
        self,
        weighed: Weighed,
        robot: Robot,
        job: Rollout,
        folder: Path,
        time_step: float,
        settings: Settings,
    ) -> None:
        _configure(settings.solver_iterations, weighed.scene.gravity)
        self.time_step = time_step
        self._system = physx.PhysxCpuSystem()
        self._system.timestep = time_step

        tool = job.tool
        moving = surfaces_of(robot, tool) | weighed.moving
        setup = Setup(
            scene=sapien.Scene([self._system]),
            surfaces=Surfaces(moving, weighed.fixed),
            folder=folder,
            time_step=time_step,
            tracking_rate=settings.tracking_rate,
        )
        self._setup = setup
        self._bodies = Bodies(setup, weighed)
        self._joints = Joints(
            weighed.scene,
            weighed.inertias,
            self._bodies.components,
            time_step,
            settings.tracking_rate,
        )
        self._acts = bool(self._joints.acting)
        self._brakes = self._bodies.brake
        self._arm = ArticulatedArm(setup, robot, tool, job.trajectory)
        self._held = robot, tool
        if weighed.scene.bonds:
            self.bonds = Bonds(setup, weighed, self._bodies.components)
        if tool.gripping:
            links = self._system.articulation_link_components
            self.gripping = Grips(
                robot,
                tool,
                weighed.scene,
                self._bodies.components,
                {link.entity.name: link for link in links},
                time_step,
            )
        if job.forces and job.record_hz > 0:
            self.impulses = Forces(self._system, weighed.scene, setup.things)

    def step(self, order: Order) -> None:
        self._arm.drive(order)
        if self._acts:
            self._joints.act()

        if self.bonds is not None:
            self._before = self._bodies.snapshot()

        self._system.step()
        if self._brakes:
            self._bodies.end_step()
        self.end_step(order)

    def note_torques(self) -> TorqueNote:
        return self._arm.note_torques()

    def read_torques(self, notes: Sequence[TorqueNote]) -> Array:
        return self._arm.read_torques(notes)

    def pushes(self) -> tuple[Array, Array]:
        return pushes(self._system, self._beyond)

    @cached_property
    def _beyond(self) -> set[Any]:
        """The collision shapes of what the arm's last joint moves."""
        links = beyond(*self._held)
        shapes: set[Any] = set()
        for link in self._system.articulation_link_components:
            if link.entity.name in links:
                shapes.update(link.collision_shapes)
        return shapes

    def launch(self) -> None:
        if self.gripping is not None:
            self.gripping.launch()
        self._arm.launch()
        self._bodies.launch()
        self._joints.begin()
        if self.bonds is not None:
            self.bonds.launch()
            self._before = b""

    def joints(self) -> tuple[Array, Array]:
        return self._arm.joints()

    def snapshot(self) -> bytes:
        """Take a snapshot; where there are bonds, the one before the last step is behind it."""
        return self._bodies.snapshot() + self._before

    def decode(self, snapshots: Sequence[bytes]) -> tuple[Array, Array, State]:
        size = len(self._bodies.snapshot())
        now = [snapshot[:size] for snapshot in snapshots]
        arm, fingers = self._arm.read(self._bodies.behind(now))
        states = self._bodies.read(now)
        if self.bonds is None:
            return arm, fingers, states

        stepped = np.array([len(snapshot) > size for snapshot in snapshots])
        before = [snapshot[-size:] for snapshot in snapshots]
        states = self.bonds.correct_speeds(states, self._bodies.read(before), stepped)
        return arm, fingers, states


def _configure(solver_iterations: int, gravity: Vector) -> None:
    """Configure PhysX. The settings belong to the process, and apply to what is created from here on."""
    physx.set_scene_config(
        gravity=list(gravity),
        bounce_threshold=_BOUNCE,
        enable_pcm=True,
        enable_tgs=True,
        enable_ccd=False,
        enable_enhanced_determinism=True,
        enable_friction_every_iteration=True,
    )
    physx.set_body_config(
        solver_position_iterations=solver_iterations,
        solver_velocity_iterations=1,
        sleep_threshold=_SLEEP,
    )
    physx.set_shape_config(contact_offset=_CONTACT_OFFSET, rest_offset=0.0)

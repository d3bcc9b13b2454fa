"""Build and step one PhysX scene with its bodies and the robot with a tool."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.interfaces import JointTrajectory
from core.scene import State
from core.values.robots import Robot as Description
from plugins.simulators.links import beyond
from plugins.simulators.sapien.bodies import GRAVITY, UNKNOWN_PACK, Bodies, Weighed
from plugins.simulators.sapien.engine import physx, sapien
from plugins.simulators.sapien.forces import Forces, pushes
from plugins.simulators.sapien.joints import Joints
from plugins.simulators.sapien.robot import ArticulatedArm, surfaces_of
from plugins.simulators.sapien.surfaces import Surfaces

# Contacts begin at this distance, metres: bodies are slowed down before they penetrate.
_CONTACT_OFFSET = 0.001
# Slower impacts don't bounce, m/s.
_BOUNCE = 0.2
# A body sleeps if its kinetic energy per mass, (m/s)^2 / 2, stays below this for 0.4 s: 3 mm/s.
_SLEEP = 5e-6


class Settings(NamedTuple):
    """The settings of `sim=sapien`, see there."""

    time_step: float
    solver_iterations: int
    tracking_rate: float


class World:
    """A fresh scene: the robot at the trajectory's first targets, free bodies at their initial poses.

    With ``forces`` the contact forces are measured. It is a `core.simulation.playback.BulkWorld` and `Launching`, and a
    `core.values.jobs.FeelingWorld`, though PhysX does not tell friction.
    """

    def __init__(
        self,
        folder: Path,
        weighed: Weighed,
        robot: Description,
        tool: Tool,
        trajectory: JointTrajectory,
        settings: Settings,
        forces: bool = False,
    ) -> None:
        time_step, iterations, tracking_rate = settings
        self.time_step = time_step
        # These settings belong to the process, and apply to what is created from here on.
        physx.set_scene_config(
            gravity=[0.0, 0.0, -GRAVITY],
            bounce_threshold=_BOUNCE,
            enable_pcm=True,
            enable_tgs=True,
            enable_ccd=False,
            enable_enhanced_determinism=True,
            enable_friction_every_iteration=True,
        )
        physx.set_body_config(
            solver_position_iterations=iterations,
            solver_velocity_iterations=1,
            sleep_threshold=_SLEEP,
        )
        physx.set_shape_config(contact_offset=_CONTACT_OFFSET, rest_offset=0.0)
        self._system = physx.PhysxCpuSystem()
        self._system.timestep = time_step
        self._scene = sapien.Scene([self._system])
        surfaces = Surfaces(surfaces_of(robot, tool) | weighed.moving, weighed.fixed)
        self._bodies = Bodies(self._scene, surfaces, weighed, folder, time_step)
        self._joints = Joints(
            weighed.scene,
            weighed.inertias,
            self._bodies.components,
            time_step,
            tracking_rate,
        )
        self._robot = ArticulatedArm(
            self._scene,
            surfaces,
            robot,
            tool,
            trajectory,
            folder,
            tracking_rate,
            time_step,
        )
        self._held = robot, tool
        if not np.allclose(
            self.read([self._bodies.note()])[0], trajectory.arm[0], atol=1e-5
        ):
            raise RuntimeError(UNKNOWN_PACK)

        self.forces = (
            Forces(self._system, weighed.scene, robot, tool) if forces else None
        )

    def step(
        self, arm: Array, fingers: float, speeds: Array, finger_speed: float
    ) -> None:
        """Drive the joints to targets (J,) and a finger opening, approached at these speeds, for one time step."""
        self._robot.drive(arm, fingers, speeds, finger_speed)
        self._joints.act()
        self._system.step()
        self._bodies.stepped()
        if self.forces:
            self.forces.add_step()

    def pushes(self) -> tuple[Array, Array]:
        return pushes(self._system, self._beyond)

    @cached_property
    def _beyond(self) -> set[Any]:
        """The collision shapes of what the arm's last joint moves."""
        links = beyond(*self._held)
        moved = [
            link
            for link in self._system.articulation_link_components
            if link.entity.name in links
        ]
        return {shape for link in moved for shape in link.collision_shapes}

    def launch(self) -> None:
        self._robot.launch()
        self._bodies.launch()
        self._joints.begin()

    def joints(self) -> tuple[Array, Array]:
        """Read the joint positions: arm (J,) and fingers (F,)."""
        return self._robot.joints()

    def state(self) -> State:
        """Read the state of the free bodies."""
        return self._bodies.state()

    def note(self) -> bytes:
        if self.forces:
            self.forces.note()
        return self._bodies.note()

    def read(self, notes: Sequence[bytes]) -> tuple[Array, Array, State]:
        return *self._robot.read(self._bodies.behind(notes)), self._bodies.read(notes)

"""Find what loads a tool in its motion: its weight, and what bodies push it with at the hardest instants.

Engines measure at which points bodies push the tool, how hard and in which direction, as a mean over the recording's
step (10 ms).

A tool that gives way is struck less hard than the rigid one of the engines: an impact of impulse J on a mass m that a
spring k holds loads the spring with J sqrt(k / m) at most. Here k is the tool's stiffness at that place, and m the
mass of the body or of the tool, whichever is less. Where that is less than the measured force, it counts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import coal
import numpy as np

from core.design import Tool
from core.designs.rules import check_contacts
from core.designs.statics import GRAVITY
from core.designs.stiffness import Beams
from core.errors import UserError
from core.geometry import Array, Pose, Sphere
from core.interfaces import Pushes, Recording
from core.robot.kinematics import link_frames
from core.robot.solids import solid_geometry
from core.scene import Scene
from core.solids.tracks import Track
from core.values.materials import Material
from core.values.robots import Robot
from plugins.results.workshop.motion import Sampled
from plugins.results.workshop.tracks import robot_tracks

HARDEST = 10
"""Instants with the largest forces on the tool, and with the largest moments; and for each body one more."""

WEIGHT = "its weight"
_DOT = solid_geometry(Sphere(1e-6))


class Load(NamedTuple):
    """A force on a component, in the frame of its mount.

    Attributes:
        what: pushes: a body, or the tool's weight.
        component: its name.
        point: where (3,), metres.
        force: (3,), newtons.
    """

    what: str
    component: str
    point: Array
    force: Array


class Instant(NamedTuple):
    """When, in seconds, and the loads that act at once."""

    time_s: float
    loads: list[Load]


class Pull(NamedTuple):
    """What a component's weight and acceleration pull it with over a motion, in the frame of its mount.

    Attributes:
        component: its name.
        center: its centre of mass (3,), metres.
        forces: (T, 3), newtons.
    """

    component: str
    center: Array
    forces: Array


def weights(tool: Tool, robot: Robot, motion: Sampled) -> list[Pull]:
    """Compute the pull on each component over a motion.

    Args:
        tool: as it was simulated.
        robot: the arm.
        motion: T samples.
    """
    fingers = np.repeat(motion.fingers[:, None], len(robot.finger_joints), axis=1)
    frames = link_frames(robot, Tool(gripper=tool.gripper), motion.positions, fingers)
    placed = tool.placed()
    found = []
    for component in tool.components:
        mount, pose = placed[component.name]
        turned, moved = frames[mount]
        middle, _ = component.shape.inertia(component.mass)
        center = pose.apply(middle)
        pulls = np.tile([0.0, 0.0, GRAVITY], (len(motion.times), 1))
        path = moved + turned @ center
        pulls[1:-1] += np.diff(path, 2, axis=0) / float(motion.times[1]) ** 2
        forces = -component.mass * np.einsum("tji,tj->ti", turned, pulls)
        found.append(Pull(component.name, center, forces))

    return found


def contact_loads(
    scene: Scene, robot: Robot, tool: Tool, material: Material, recording: Recording
) -> list[Instant]:
    """Find the hardest instants of a recorded rollout, with what bodies load the tool with.

    Args:
        scene: its bodies, of which free ones strike no harder than their mass lets them.
        robot: the arm.
        tool: what it holds.
        material: of the tool; it says how much it gives way.
        recording: of the rollout, with forces.

    Raises:
        UserError: the engine does not tell where forces act.
        DesignError: a component does not touch its parent.
    """
    forces = {}
    for (first, second), values in recording.forces.items():
        if first == "tool":
            forces[second] = values

    if not forces or not tool.components:
        return []

    pushes = recording.pushes
    if pushes is None:
        raise UserError(
            "an engine of sims measures how hard the tool is pushed, but not where (Recording.pushes); name others"
        )

    masses = {body.name: body.mass for body in scene.free}
    beams = Beams(tool, check_contacts(tool, robot), material)
    parts = _Parts(robot, tool, recording)
    found = []
    for sample in _choose_hardest(recording, forces, pushes, parts):
        loads = []
        for name, values in forces.items():
            pushed = parts.loads(sample, name, pushes)
            if pushed and name in masses:
                hardest = max(pushed, key=lambda load: np.linalg.norm(load.force))
                soft = beams.bend(hardest.component, hardest.point)[0]
                mass = min(masses[name], tool.mass)
                most = _impact(recording.times, values, sample, mass, soft)
                share = min(1.0, most / max(values[sample], 1e-9))
                pushed = [load._replace(force=share * load.force) for load in pushed]

            loads += pushed

        found.append(Instant(float(recording.times[sample]), loads))

    return found


def _choose_hardest(
    recording: Recording, forces: Mapping[str, Array], pushes: Pushes, parts: _Parts
) -> list[int]:
    """Choose the instants that are looked at.

    Args:
        recording: T instants.
        forces: of each body on the tool (T,), newtons.
        pushes: the contact points of all instants.
        parts: the tool's parts, about whose mount moments count.

    Returns:
        The numbers of the instants, in order.
    """
    moment = np.zeros((len(recording.times), 3))
    force = np.zeros((len(recording.times), 3))
    np.add.at(moment, pushes.samples, np.cross(pushes.points, pushes.forces))
    np.add.at(force, pushes.samples, pushes.forces)
    mount = parts.frames[parts.tool.mounts[0]][1]
    moments = np.linalg.norm(moment - np.cross(mount, force), axis=1)

    by_body = np.array(list(forces.values()))
    most_force = np.argsort(by_body.sum(axis=0))[-HARDEST:]
    most_moment = np.argsort(moments)[-HARDEST:]
    chosen = np.unique(
        np.concatenate([by_body.argmax(axis=1), most_force, most_moment])
    )
    found: list[int] = chosen[by_body[:, chosen].max(axis=0) > 0].tolist()

    return found


def _impact(
    times: Array, values: Array, sample: int, mass: float, soft: float
) -> float:
    """Compute the largest force of an impact on a spring: its impulse times sqrt(k / m).

    The impulse is that of the forces in half of the spring's period.

    Args:
        times: (T,), s.
        values: the forces (T,), newtons.
        sample: the number of the instant in the middle.
        mass: m, kg.
        soft: 1 / k, metres per newton.
    """
    turn = 1 / math.sqrt(mass * max(soft, 1e-12))
    within = np.abs(times - times[sample]) <= math.pi / turn / 2
    return turn * float((values * np.gradient(times))[within].sum())


class _Parts:
    """The tool's parts halfway between the instants of a recording, at which steps are on average.

    Attributes:
        tool: whose parts they are.
        frames: rotations (T, 3, 3) and positions (T, 3) of what bears them, by name.
    """

    def __init__(self, robot: Robot, tool: Tool, recording: Recording) -> None:
        arm = _halfway(recording.arm)
        fingers = _halfway(recording.fingers)
        halfway = replace(recording, arm=arm, fingers=fingers)
        self.tool = tool
        self._tracks = robot_tracks(robot, tool, halfway)[-len(tool.parts) :]
        self.frames = link_frames(robot, tool, arm, fingers)

        placed = tool.placed()
        links = {component.name: component.link for component in tool.components}
        self._rest = {
            name: placed[name][1] @ links[name] if name in placed else Pose()
            for name in tool.borne_on
        }

    def loads(self, sample: int, body: str, pushes: Pushes) -> list[Load]:
        """Return what a body loads the tool with at an instant, as the tool is at rest."""
        acting = (pushes.samples == sample) & (pushes.bodies == body)
        return [
            self._load(sample, body, pushes.points[i], pushes.forces[i])
            for i in np.flatnonzero(acting)
        ]

    def _load(self, sample: int, body: str, point: Array, force: Array) -> Load:
        """Find the component that has a contact point in the world, and what loads it."""
        gaps = [self._gap(track, sample, point) for track in self._tracks]
        part = self.tool.parts[int(np.argmin(gaps))]
        turned, moved = self.frames[part.bearer]
        rest = self._rest[part.bearer]
        to_bearer = turned[sample].T
        place = rest.apply(to_bearer @ (point - moved[sample]))
        turned_force = rest.rotation.apply(to_bearer @ force)

        return Load(body, part.component, place, turned_force)

    def _gap(self, track: Track, sample: int, point: Array) -> float:
        """How far a point is from the surface of a part."""
        dot = coal.Transform3s(np.eye(3), point)
        between = (track.geometry, track.at(sample), _DOT, dot)
        gap = coal.distance(*between, coal.DistanceRequest(), coal.DistanceResult())

        return abs(float(gap))


def _halfway(joints: Array) -> Array:
    """Return joints (T, J) halfway from the instant before."""
    before = np.vstack([joints[:1], joints[:-1]])
    return (joints + before) / 2

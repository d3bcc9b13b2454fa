"""Estimate how far a tool is from breaking in its motion: its joints and components under the forces of the rollout.

Engines measure at which points bodies push the tool, how hard and in which direction, as a mean over the recording's
step (10 ms). At each of the hardest instants the moments of these forces and of the tool's weight, with what the motion
adds to it there, sum up as vectors in each section: forces that oppose each other do so here, too.

A tool that gives way is struck less hard than the rigid one of the engines: an impact of impulse J on a mass m that a
spring k holds loads the spring with J sqrt(k / m) at most. Here k is the tool's stiffness at that place, and m the
mass of the body or of the tool, whichever is less. Where that is less than the measured force, it counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import coal
import numpy as np

from core.design import Tool
from core.designs.rules import check_contacts
from core.designs.statics import GRAVITY, POINT_M, Beam, Beams
from core.errors import UserError
from core.geometry import Array, Pose, mass_properties
from core.interfaces import Pushes, Recording
from core.robot.kinematics import link_frames
from core.scene import Scene
from core.values.materials import Material
from core.values.robots import Robot
from plugins.results.workshop.motion import PlayedMotion, Sampled
from plugins.results.workshop.tracks import robot_tracks

HARDEST = 10  # instants with the largest forces on the tool, and with the largest moments; and for each body one more
NEAR_M = (
    0.005  # of a contact point to the bounding boxes of components that may have it
)
WEIGHT = "its weight"
_DOT = coal.Sphere(1e-6)


class Load(NamedTuple):
    """A ``force`` (3,), newtons, at a ``point`` (3,) of a component, in the frame of its mount; ``what`` names it."""

    what: str
    component: str
    point: Array
    force: Array


Instant = tuple[float, Sequence[Load]]
"""When, in seconds, and the loads that act at once."""


@dataclass(frozen=True)
class Strength:
    """The worst that loads do to a component at one instant; units are SI.

    Attributes:
        component: the stress is in its section that bears most, which is at one of its joints.
        parent: the component or mount that carries it.
        load: what adds most to the stress: a body, or the tool's weight; ``newtons`` is its resultant.
        engine: where the force was measured; empty: it is the weight alone.
        time_s: when.
        lever_m: from the section to the load.
        stress_pa: with all loads that act at that instant.
        safety: the material's strength over the stress; None: the material has none.
        bend_m: by how much the load would move its own place, across and alone, from the mount on.
    """

    component: str
    parent: str
    load: str
    newtons: float
    engine: str
    time_s: float
    lever_m: float
    stress_pa: float
    safety: float | None
    bend_m: float


def weights(
    tool: Tool, robot: Robot, motion: Sampled
) -> list[tuple[str, Array, Array]]:
    """Return for each component its centre of mass (3,) and its pull on it (T, 3) over a motion, in its mount's frame.

    The pull is its weight and what its acceleration adds.
    """
    fingers = np.repeat(motion.fingers[:, None], len(robot.finger_joints), axis=1)
    frames = link_frames(robot, Tool(gripper=tool.gripper), motion.positions, fingers)
    found = []
    for component in tool.components:
        mount, pose = tool.placed()[component.name]
        (turned, moved), center = (
            frames[mount],
            pose.apply(mass_properties(component.shape, component.mass)[0]),
        )
        pulls = np.tile([0.0, 0.0, GRAVITY], (len(motion.times), 1))
        pulls[1:-1] += (
            np.diff(moved + turned @ center, 2, axis=0) / float(motion.times[1]) ** 2
        )
        found.append(
            (
                component.name,
                center,
                -component.mass * np.einsum("tji,tj->ti", turned, pulls),
            )
        )
    return found


def contact_loads(
    scene: Scene, robot: Robot, tool: Tool, material: Material, recording: Recording
) -> list[tuple[float, list[Load]]]:
    """Return the hardest instants of a recorded rollout: when, and the loads on the tool.

    Raises:
        UserError: the engine does not tell where forces act.
        DesignError: a component does not touch its parent.
    """
    forces = {
        other: values
        for (one, other), values in recording.forces.items()
        if one == "tool"
    }
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
    for sample in _hardest(recording, forces, pushes, parts):
        loads = []
        for name, values in forces.items():
            mine = np.flatnonzero((pushes.samples == sample) & (pushes.bodies == name))
            own = [
                Load(name, *parts.on(sample, pushes.points[i], pushes.forces[i]))
                for i in mine
            ]
            if own and name in masses:
                hardest = max(own, key=lambda load: np.linalg.norm(load.force))
                soft = beams.bend(hardest.component, hardest.point)[0]
                most = _struck(
                    recording.times, values, sample, min(masses[name], tool.mass), soft
                )
                share = min(1.0, most / max(values[sample], 1e-9))
                own = [load._replace(force=share * load.force) for load in own]
            loads += own
        found.append((float(recording.times[sample]), loads))
    return found


def _hardest(
    recording: Recording, forces: Mapping[str, Array], pushes: Pushes, parts: _Parts
) -> list[int]:
    """Choose the instants that are looked at."""
    every = np.array(list(forces.values()))
    total = np.zeros((2, len(recording.times), 3))
    np.add.at(total[0], pushes.samples, np.cross(pushes.points, pushes.forces))
    np.add.at(total[1], pushes.samples, pushes.forces)
    mount = parts.frames[parts.tool.mounts[0]][1]
    moments = np.linalg.norm(total[0] - np.cross(mount, total[1]), axis=1)
    most = (np.argsort(of)[-HARDEST:] for of in (every.sum(axis=0), moments))
    chosen = np.unique(np.concatenate([every.argmax(axis=1), *most]))
    found: list[int] = chosen[every[:, chosen].max(axis=0) > 0].tolist()
    return found


def _struck(
    times: Array, values: Array, sample: int, mass: float, soft: float
) -> float:
    """The largest force of an impact on a spring of ``soft`` metres per newton: its impulse times sqrt(k / m).

    The impulse is that of the forces (T,), newtons, in half of the spring's period.
    """
    turn = 1 / math.sqrt(mass * max(soft, 1e-12))
    within = np.abs(times - times[sample]) <= math.pi / turn / 2
    return turn * float((values * np.gradient(times))[within].sum())


class _Parts:
    """The tool's parts halfway between the instants of a recording, at which steps are on average.

    ``frames`` holds the rotations (T, 3, 3) and positions (T, 3) of what bears them.
    """

    def __init__(self, robot: Robot, tool: Tool, recording: Recording) -> None:
        arm, fingers = (
            (of + np.vstack([of[:1], of[:-1]])) / 2
            for of in (recording.arm, recording.fingers)
        )
        halfway = replace(recording, arm=arm, fingers=fingers)
        self.tool, self._tracks = (
            tool,
            robot_tracks(robot, tool, halfway)[-len(tool.parts) :],
        )
        self.frames = link_frames(robot, tool, arm, fingers)
        placed = tool.placed()
        links_at = {c.name: c.link for c in tool.components}
        self._rest = {
            name: placed[name][1] @ links_at[name] if name in placed else Pose()
            for name in tool.borne_on
        }

    def on(self, sample: int, point: Array, force: Array) -> tuple[str, Array, Array]:
        """Find the component that has a contact point; return it, with point and force as it is at rest."""
        beyond = [
            np.abs((point - of.middles[sample]) @ of.rotations[sample]) - of.box
            for of in self._tracks
        ]
        gaps = [float(np.linalg.norm(np.maximum(each, 0))) for each in beyond]
        near = [i for i, gap in enumerate(gaps) if gap <= min(gaps) + NEAR_M]
        part = self.tool.parts[min(near, key=lambda i: self._gap(i, sample, point))]
        (turned, moved), rest = self.frames[part.bearer], self._rest[part.bearer]
        own = turned[sample].T @ (point - moved[sample])
        way = turned[sample].T @ force
        return part.component, rest.apply(own), rest.rotation.apply(way)

    def _gap(self, i: int, sample: int, point: Array) -> float:
        """How far a point is from the surface of a part."""
        track = self._tracks[i]
        dot = coal.Transform3s(np.eye(3), point)
        request = coal.DistanceRequest()
        result = coal.DistanceResult()
        return abs(
            float(
                coal.distance(
                    track.geometry, track.at(sample, 0.0)[0], _DOT, dot, request, result
                )
            )
        )


def _stresses(
    tool: Tool, beams: Beams, most_pa: float | None, engine: str, instant: Instant
) -> Iterator[Strength]:
    """Estimate what loads that act at once do to each component that carries one.

    The moments of all loads beyond a section add up as vectors, so that loads that oppose each other do so here.
    Sections are looked at where a component is held, and where a load acts on it or comes from what it carries.
    """
    time_s, loads = instant
    carried: dict[str, list[tuple[Load, Beam]]] = {}
    for load in loads:
        for carrier, beam in [
            *beams.chains[load.component],
            (load.component, beams.beam(load.component, load.point)),
        ]:
            carried.setdefault(carrier, []).append((load, beam))
    for component in tool.components:
        if component.name not in carried:
            continue
        stress, place, beyond = _weakest(carried[component.name])
        groups: dict[str, list[Load]] = {}
        for load in beyond:
            groups.setdefault(load.what, []).append(load)
        if not groups:
            continue
        turns = {
            name: sum(np.cross(load.point - place, load.force) for load in own)
            for name, own in groups.items()
        }
        what = max(turns, key=lambda name: np.linalg.norm(turns[name]))
        newtons = float(np.linalg.norm(sum(load.force for load in groups[what])))
        hardest = max(groups[what], key=lambda load: np.linalg.norm(load.force))
        yield Strength(
            component=component.name,
            parent=component.parent,
            load=what,
            newtons=newtons,
            engine="" if what == WEIGHT else engine,
            time_s=time_s,
            lever_m=float(np.linalg.norm(hardest.point - place)),
            stress_pa=stress,
            safety=most_pa / stress if most_pa is not None and stress > 0 else None,
            bend_m=newtons * beams.bend(hardest.component, hardest.point)[0],
        )


def _weakest(carried: Sequence[tuple[Load, Beam]]) -> tuple[float, Array, list[Load]]:
    """Find the section of a component that bears most: its stress, its place (3,), and the loads beyond it."""
    loads = [load for load, _ in carried]
    starts, stops, _, weak = map(
        np.array, zip(*(beam for _, beam in carried), strict=True)
    )
    forces, points = (np.array([load[k] for load in loads]) for k in (3, 2))
    ways = stops - starts
    along = (
        ways @ ways.T
    )  # (N, N): how far each gets along the way of another, times its length
    lengths = np.maximum(np.sqrt(np.diagonal(along)), POINT_M)
    turning = np.cross(points, forces)
    best: tuple[float, Array, Array] = (
        -1.0,
        starts[0],
        np.zeros(len(loads), dtype=bool),
    )
    for sections, beyond in (
        (starts, along / lengths[:, None] > POINT_M),
        (stops, along / lengths[:, None] >= lengths[:, None] - POINT_M),
    ):
        moments = beyond @ turning - np.cross(sections, beyond @ forces)
        stress = weak * np.linalg.norm(moments, axis=1)
        k = int(stress.argmax())
        if stress[k] > best[0]:
            best = float(stress[k]), sections[k], beyond[k]
    return (
        best[0],
        best[1],
        [load for load, counts in zip(loads, best[2], strict=True) if counts],
    )


def strength(
    tool: Tool,
    robot: Robot,
    material: Material,
    instants: Mapping[str, Sequence[Instant]],
) -> list[Strength]:
    """Find for each component the worst of the instants of all engines; those of no engine have the name "".

    Raises:
        DesignError: a component does not touch its parent.
    """
    beams = Beams(tool, check_contacts(tool, robot), material)
    worst: dict[str, Strength] = {}
    for engine, own in instants.items():
        for instant in own:
            for row in _stresses(tool, beams, material.strength_pa, engine, instant):
                if (
                    row.component not in worst
                    or row.stress_pa > worst[row.component].stress_pa
                ):
                    worst[row.component] = row
    return [
        worst[component.name]
        for component in tool.components
        if component.name in worst
    ]


def measured(
    tool: Tool,
    robot: Robot,
    material: Material,
    scene: Scene,
    motion: Sampled,
    replays: Mapping[str, PlayedMotion],
) -> list[Strength]:
    """Find the worst of a motion that was played in engines, and without any; of their stresses the largest counts.

    Raises:
        UserError: an engine does not tell where forces act.
        DesignError: a component does not touch its parent.
    """
    pulls = weights(tool, robot, motion)

    def pulled(when: float) -> list[Load]:
        k = int(np.clip(np.searchsorted(motion.times, when), 0, len(motion.times) - 1))
        return [Load(WEIGHT, name, center, force[k]) for name, center, force in pulls]

    hardest = {int(np.linalg.norm(force, axis=1).argmax()) for *_, force in pulls}
    times = [float(motion.times[k]) for k in sorted(hardest)]
    instants: dict[str, list[Instant]] = {"": [(when, pulled(when)) for when in times]}
    for name, replay in replays.items():
        found = contact_loads(scene, robot, tool, material, replay.recording)
        instants[name] = [(when, [*pulled(when), *loads]) for when, loads in found]
    return strength(tool, robot, material, instants)

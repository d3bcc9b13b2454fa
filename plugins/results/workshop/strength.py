"""Estimate how far a tool is from breaking in its motion: its joints and components under the forces of the rollout.

At each of the hardest instants (`plugins.results.workshop.loads`) the moments of the forces on the tool and of its
weight, with what the motion adds to it there, sum up as vectors in each section: forces that oppose each other do so
here, too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple

import numpy as np

from core.design import Tool
from core.designs.rules import check_contacts
from core.designs.stiffness import POINT_M, Beam, Beams
from core.geometry import Array
from core.scene import Scene
from core.values.materials import Material
from core.values.robots import Robot
from plugins.results.workshop.joints import Joint
from plugins.results.workshop.loads import (
    WEIGHT,
    Instant,
    Load,
    contact_loads,
    weights,
)
from plugins.results.workshop.motion import Sampled
from plugins.results.workshop.replay import PlayedMotion
from plugins.results.workshop.tool import PrintedTool


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
        bearer: the component on which the load acts.
        place: where (3,), metres, in the frame of its mount.
        moved: where to (3,), as long as ``bend_m``.
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
    bearer: str = ""
    place: tuple[float, ...] = (0.0, 0.0, 0.0)
    moved: tuple[float, ...] = (0.0, 0.0, 0.0)


class Section(NamedTuple):
    """A section of a component or of a joint between pieces, and what loads it.

    Attributes:
        component: its name, or that of the joint.
        parent: the component or mount that carries it.
        place: (3,), metres, in the frame of the mount.
        stress_pa: by all loads beyond it.
        loads: those that are named: of a component, of what turns the section most.
    """

    component: str
    parent: str
    place: Array
    stress_pa: float
    loads: Sequence[Load]


def measured(
    printed: PrintedTool,
    robot: Robot,
    scene: Scene,
    motion: Sampled,
    replays: Mapping[str, PlayedMotion],
) -> list[Strength]:
    """Find the worst that a motion does to a tool, where it was played in engines and by its weight alone.

    Args:
        printed: the tool, with its joints between pieces.
        robot: the arm.
        scene: its bodies.
        motion: as it is exported.
        replays: the motion in each engine, by the engine's name.

    Returns:
        For each component and joint that carries something the largest stress.

    Raises:
        UserError: an engine does not tell where forces act.
        DesignError: a component does not touch its parent.
    """
    tool = printed.tool
    material = printed.material
    pulls = weights(tool, robot, motion)
    hardest = {int(np.linalg.norm(pull.forces, axis=1).argmax()) for pull in pulls}

    def pulled(sample: int) -> list[Load]:
        return [
            Load(WEIGHT, pull.component, pull.center, pull.forces[sample])
            for pull in pulls
        ]

    instants: dict[str, list[Instant]] = {"": []}
    for sample in sorted(hardest):
        instants[""].append(Instant(float(motion.times[sample]), pulled(sample)))

    last = len(motion.times) - 1

    for name, replay in replays.items():
        instants[name] = []
        for found in contact_loads(scene, robot, tool, material, replay.recording):
            sample = min(int(np.searchsorted(motion.times, found.time_s)), last)
            loads = [*pulled(sample), *found.loads]
            instants[name].append(Instant(found.time_s, loads))

    return strength(tool, robot, material, instants, printed.joints)


def strength(
    tool: Tool,
    robot: Robot,
    material: Material,
    instants: Mapping[str, Sequence[Instant]],
    joints: Sequence[Joint] = (),
) -> list[Strength]:
    """Find for each component, and each joint between pieces, the worst of some instants.

    Args:
        tool: as it was simulated.
        robot: the arm.
        material: of the tool.
        instants: of each engine, by its name; those of no engine have the name "".
        joints: between the pieces that components were cut into.

    Raises:
        DesignError: a component does not touch its parent.
    """
    beams = Beams(tool, check_contacts(tool, robot), material)
    worst: dict[str, Strength] = {}
    for engine, of_engine in instants.items():
        for instant in of_engine:
            sections = chain(
                _list_sections(tool, beams, instant.loads),
                _list_joints(joints, beams, instant.loads),
            )
            for section in sections:
                known = worst.get(section.component)
                if known is None or section.stress_pa > known.stress_pa:
                    row = _describe(section, beams, engine, instant.time_s)
                    worst[section.component] = row

    names = [component.name for component in tool.components]
    names += [joint.name for joint in joints]

    return [worst[name] for name in names if name in worst]


def _describe(section: Section, beams: Beams, engine: str, time_s: float) -> Strength:
    """Say what loads do to a section.

    Args:
        section: with its loads.
        beams: the tool's components.
        engine: where the loads were measured.
        time_s: when.
    """
    hardest = max(section.loads, key=lambda load: np.linalg.norm(load.force))
    force = np.sum([load.force for load in section.loads], axis=0)
    newtons = float(np.linalg.norm(force))
    softness = beams.bend(hardest.component, hardest.point)[0]

    most_pa = beams.material.strength_pa
    safety = None
    if most_pa is not None and section.stress_pa > 0:
        safety = most_pa / section.stress_pa

    return Strength(
        component=section.component,
        parent=section.parent,
        load=hardest.what,
        newtons=newtons,
        engine="" if hardest.what == WEIGHT else engine,
        time_s=time_s,
        lever_m=float(np.linalg.norm(hardest.point - section.place)),
        stress_pa=section.stress_pa,
        safety=safety,
        bend_m=newtons * softness,
        bearer=hardest.component,
        place=tuple(hardest.point.tolist()),
        moved=tuple((force * softness).tolist()),
    )


def _list_sections(
    tool: Tool, beams: Beams, loads: Sequence[Load]
) -> Iterator[Section]:
    """Yield the weakest section of each component that carries loads which act at once.

    The moments of all loads beyond a section add up as vectors, so that loads that oppose each other do so here.
    Sections are looked at where a component is held, and where a load acts on it or comes from what it carries.
    """
    carried: dict[str, list[tuple[Load, Beam]]] = {}
    for load in loads:
        last = beams.beam(load.component, load.point)
        for carrier, beam in [*beams.chains[load.component], (load.component, last)]:
            carried.setdefault(carrier, []).append((load, beam))

    for component in tool.components:
        if component.name not in carried:
            continue

        stress, place, beyond = _find_weakest(carried[component.name])
        hardest = _choose_hardest(beyond, place)
        if hardest:
            yield Section(component.name, component.parent, place, stress, hardest)


def _choose_hardest(loads: Sequence[Load], place: Array) -> Sequence[Load]:
    """Return the loads of what turns a section most."""
    groups: dict[str, list[Load]] = {}
    for load in loads:
        groups.setdefault(load.what, []).append(load)

    def turn(of_one: Sequence[Load]) -> float:
        return float(np.linalg.norm(_moment(of_one, place)))

    return max(groups.values(), key=turn, default=[])


def _moment(loads: Sequence[Load], place: Array) -> Array:
    """Add up the moments (3,) of loads about a place (3,)."""
    moments = [np.cross(load.point - place, load.force) for load in loads]
    return np.asarray(np.sum(moments, axis=0))


def _list_joints(
    joints: Sequence[Joint], beams: Beams, loads: Sequence[Load]
) -> Iterator[Section]:
    """Yield the joints between pieces that carry loads, by their tongues, or by their sockets' walls."""
    for joint in joints:
        beyond = [load for load in loads if _is_beyond(joint, load, beams)]
        if not beyond:
            continue

        about = np.abs(_moment(beyond, joint.place) @ joint.frame[:3, :3])
        about_x, about_y = (1e-9 * modulus for modulus in joint.moduli_mm3)
        stress = about[0] / about_x + about[1] / about_y
        stress += about[2] / (about_x + about_y)

        yield Section(joint.name, joint.component, joint.place, float(stress), beyond)


def _is_beyond(joint: Joint, load: Load, beams: Beams) -> bool:
    """Report whether a load is carried through a joint: whether it comes to the side without the mount.

    Args:
        joint: in a component.
        load: on this component, or on another.
        beams: the tool's components, and where they touch.
    """
    parents = {item.name: item.parent for item in beams.tool.components}
    name = load.component
    point = load.point
    while name != joint.component:
        if name not in parents:
            return False

        point = beams.joints[name]
        name = parents[name]

    def side(place: Array) -> bool:
        return bool((place - joint.place) @ joint.along > 0)

    return side(point) != side(beams.joints[name])


def _find_weakest(
    carried: Sequence[tuple[Load, Beam]],
) -> tuple[float, Array, list[Load]]:
    """Find the section of a component that bears most.

    Args:
        carried: the N loads that it carries, each with the beam that leads to it within the component.

    Returns:
        Its stress, its place (3,), and the loads beyond it.
    """
    loads = [load for load, _ in carried]
    beams = [beam for _, beam in carried]
    starts, stops, _, weak = map(np.array, zip(*beams, strict=True))
    points = np.array([load.point for load in loads])
    forces = np.array([load.force for load in loads])
    turning = np.cross(points, forces)

    # (N, N): how far each beam gets along the way of another, times its length.
    ways = stops - starts
    along = ways @ ways.T
    lengths = np.maximum(np.sqrt(np.diagonal(along)), POINT_M)[:, None]
    beyond_starts = along / lengths > POINT_M
    beyond_stops = along / lengths >= lengths - POINT_M

    weakest = (-1.0, starts[0], list[Load]())
    for places, beyond in ((starts, beyond_starts), (stops, beyond_stops)):
        moments = beyond @ turning - np.cross(places, beyond @ forces)
        stress = weak * np.linalg.norm(moments, axis=1)
        k = int(stress.argmax())
        if stress[k] > weakest[0]:
            counted = [loads[i] for i in np.flatnonzero(beyond[k])]
            weakest = (float(stress[k]), places[k], counted)

    return weakest

"""Estimate how far a tool is from breaking in its motion: its joints and components under the forces of the rollout.

Engines measure how hard the tool and a body press on each other, as a mean over the recording's step (10 ms); where on
the tool, and in which direction, they don't say. So the whole force acts on each component that touches the body then,
at the worst corner of the part that is within the body's bounding box, and across all that carries it. Forces of
several bodies at one instant add up, and to them the tool's weight, with what the motion adds to it at most.

A tool that gives way is struck less hard than the rigid one of the engines: an impact of impulse J on a mass m that a
spring k holds loads the spring with J sqrt(k / m) at most. Here k is the tool's stiffness at that place, and m the
mass of the body or of the tool, whichever is less. Where that is less than the measured force, it counts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import coal
import numpy as np

from core.design import Tool
from core.designs.rules import check_contacts
from core.designs.stiffness import Load, Stressed, stresses
from core.designs.weight import GRAVITY
from core.geometry import Array, Sphere, mass_properties
from core.interfaces import Recording
from core.materials import Material
from core.robot.frames import link_frames
from core.robots import Robot
from core.scene import Scene
from core.simulation.sampling import subset
from core.simulation.tracks import Track, body_tracks, robot_tracks

if TYPE_CHECKING:
    from core.export.motion import Sampled
    from core.export.replay import Replay

HARDEST = 10  # instants with the largest force on the tool; and for each body one more
TOUCH_M = 0.001  # components that are farther from a body than the nearest one by less than this touch it too
WEIGHT = "its weight"


@dataclass(frozen=True)
class Strength:
    """The worst that happens to a component in its motion; units are SI.

    Attributes:
        component: the stress is in its section that bears most, which is at one of its joints.
        parent: the component or mount that carries it.
        load: what adds most to the stress: a body, or the tool's weight; ``newtons`` is how large that is.
        engine: where the force was measured; empty: it is the weight alone.
        time_s: when.
        lever_m: from the section to the load.
        stress_pa: with all loads that act at that instant.
        safety: the material's strength over the stress; None: the material has none.
        bend_m: by how much the load moves its own place, from the mount on.
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


def weights(tool: Tool, robot: Robot, motion: Sampled) -> list[Load]:
    """Return each component's weight as a load at its centre of mass, with the largest acceleration of a motion."""
    fingers = np.repeat(motion.fingers[:, None], len(robot.finger_joints), axis=1)
    frames, found = link_frames(robot, tool.gripper, motion.positions, fingers), []
    for component in tool.components:
        mount, pose = tool.placed()[component.name]
        (turned, moved), center = frames[mount], pose.apply(mass_properties(component.shape, component.mass)[0])
        pulls = np.diff(moved + turned @ center, 2, axis=0) / float(motion.times[1]) ** 2 + (0.0, 0.0, GRAVITY)
        most = float(np.linalg.norm(pulls, axis=1).max(initial=GRAVITY))
        found.append(Load(WEIGHT, component.mass * most, {component.name: center[None]}))
    return found


def contact_loads(
    scene: Scene, robot: Robot, tool: Tool, material: Material, recording: Recording
) -> list[tuple[float, list[Load]]]:
    """Return the hardest instants of a recorded rollout: when, and the loads on the tool.

    Raises:
        DesignError: a component does not touch its parent.
    """
    forces = {other: values for (one, other), values in recording.forces.items() if one == "tool"}
    if not forces or not tool.components:
        return []
    joints, placed, masses = check_contacts(tool, robot), tool.placed(), {body.name: body.mass for body in scene.free}
    every = np.array(list(forces.values()))
    hardest = np.unique([*every.argmax(axis=1), *np.argsort(every.sum(axis=0))[-HARDEST:]])
    hardest = hardest[every[:, hardest].max(axis=0) > 0]
    taken = subset(recording, hardest)
    parts = robot_tracks(robot, tool, taken)[-len(tool.parts) :]
    bodies = body_tracks(scene, taken)
    found = []
    for k, sample in enumerate(hardest.tolist()):
        loads = []
        for name, values in forces.items():
            body = [track for track in bodies if track.owner == name]
            if values[sample] > 0 and body:
                places = _places(tool, parts, body, k)
                newtons = float(values[sample])
                if name in masses:
                    of = stresses(tool, joints, material, [Load(name, 1.0, places)])
                    soft = min(of[component].bend_m for component in places)
                    newtons = min(newtons, _struck(recording.times, values, sample, min(masses[name], tool.mass), soft))
                fingers = len({placed[component][0] for component in places})  # each has its share of what they hold
                loads.append(Load(name, newtons / fingers, places))
        found.append((float(recording.times[sample]), loads))
    return found


def _struck(times: Array, values: Array, sample: int, mass: float, soft: float) -> float:
    """The largest force of an impact on a spring of ``soft`` metres per newton: its impulse times sqrt(k / m).

    The impulse is that of the forces (T,), newtons, in half of the spring's period.
    """
    turn = 1 / math.sqrt(mass * max(soft, 1e-12))
    within = np.abs(times - times[sample]) <= math.pi / turn / 2
    return turn * float((values * np.gradient(times))[within].sum())


def _places(tool: Tool, parts: Sequence[Track], body: Sequence[Track], k: int) -> dict[str, Array]:
    """Find where a body may press on the components that touch it at sample ``k``, in the frames of their mounts."""
    placed = tool.placed()
    gaps: list[tuple[float, Track, Track]] = []
    for one in parts:
        for other in body:
            distance = coal.ComputeDistance(one.geometry, other.geometry)
            transforms = _at(one, k)[0], _at(other, k)[0]
            gaps.append((distance(*transforms, coal.DistanceRequest(), coal.DistanceResult()), one, other))
    nearest = max(min((gap for gap, *_ in gaps), default=0.0), 0.0)
    places: dict[str, list[Array]] = {}
    for gap, one, other in gaps:
        if gap <= nearest + TOUCH_M:
            corners = placed[one.name][1].apply(_shared(one, other, k))
            places.setdefault(one.name, []).append(corners)
    return {name: np.vstack(corners) for name, corners in places.items()}


def _at(track: Track, k: int) -> tuple[Any, Array]:
    return track.at(min(k, len(track.positions) - 1), 0.0)


def _shared(one: Track, other: Track, k: int) -> Array:
    """The corners (8, 3) of the part of a solid's bounding box that is within another's, in the solid's frame."""
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, 8).T
    (_, turn), (_, turned), here = _at(one, k), _at(other, k), one.positions[k]
    i = min(k, len(other.positions) - 1)
    middle = turn.T @ (one.middles[k] - here)
    low, high = middle - one.box, middle + one.box
    if not isinstance(one.shape, Sphere):  # whose frame does not turn with the tool
        corners = (other.middles[i] + (signs * other.box) @ turned.T - here) @ turn
        low, high = np.clip(corners.min(axis=0), low, high), np.clip(corners.max(axis=0), low, high)
    shared: Array = np.where(signs < 0, low, high)
    return shared


def strength(
    tool: Tool,
    robot: Robot,
    material: Material,
    instants: Mapping[str, Sequence[tuple[float, Sequence[Load]]]],
    carried: Sequence[Load] = (),
) -> list[Strength]:
    """Find for each component the worst of the instants of all engines; ``carried`` acts at each of them.

    Raises:
        DesignError: a component does not touch its parent.
    """
    joints = check_contacts(tool, robot)
    worst: dict[str, tuple[Stressed, str, float]] = {}
    cases = [(engine, when, loads) for engine, of in instants.items() for when, loads in of]
    for engine, when, loads in [("", 0.0, ()), *cases]:
        for name, found in stresses(tool, joints, material, [*carried, *loads]).items():
            if name not in worst or found.stress_pa > worst[name][0].stress_pa:
                worst[name] = found, engine, when
    most, rows = material.strength_pa, []
    for component in tool.components:
        if component.name in worst:
            found, engine, when = worst[component.name]
            safety = most / found.stress_pa if most is not None and found.stress_pa > 0 else None
            engine = "" if found.what == WEIGHT else engine
            of = (found.what, found.newtons, engine, when, found.lever_m, found.stress_pa, safety, found.bend_m)
            rows.append(Strength(component.name, component.parent, *of))
    return rows


def measured(
    tool: Tool, robot: Robot, material: Material, scene: Scene, motion: Sampled, replays: Mapping[str, Replay]
) -> list[Strength]:
    """Find the worst of a motion that was played in engines; of their forces the larger one counts."""
    instants = {name: contact_loads(scene, robot, tool, material, replay.recording) for name, replay in replays.items()}
    return strength(tool, robot, material, instants, weights(tool, robot, motion))

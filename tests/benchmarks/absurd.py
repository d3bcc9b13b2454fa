"""Define what the adversarial search varies, and when a tool is absurd. Used by `tests.benchmarks.adversary`.

A start is a tool with a plan. Numbers around zero bend it: sizes, angles and places of the boxes, and all waypoints.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import coal
import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Candidate, Component, Evaluation, Tool
from core.designs import rules
from core.geometry import Array, Box, Cylinder, Mesh, Pose, Sphere
from core.interfaces import JointTrajectory, Outcome, Recording, Rollout, Simulator, Task
from core.robot.trajectory import at_home
from core.scene import Body, Scene, State
from core.solids.tracks import Track, body_tracks, robot_tracks
from tests.panda import PANDA

PARTED_M, EARLY_M = 0.005, 0.005
LIGHT, SHEET_M, BLADE_M = 1.02, 0.00095, 0.002  # the first: over the least mass that the rules allow
GHOST_M, TIP_M_S, INSIDE_CM2, AIR_M = 0.008, 6.0, 1.0, 0.02  # from here on a motion or an end counts as absurd
COMMANDED_HZ, LOOKED_HZ = 25.0, 50.0
_SIZE, _TURN_RAD, _JOINT, _WAY_M, _WAY_RAD, _GRIP = 0.4, 0.2, 0.4, 0.04, 0.15, 0.3  # what a number of 1 changes
_TOUCH_M, EATEN_M = 0.002, 0.003
_EMPTY = Scene(())
_AT_REST_M_S, _LIFTED_M = 0.1, 0.01


# --- tools and plans --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Start:
    """A tool and a plan, which numbers (`size` of them) bend, nine for each box. Boxes stay joined where they touch."""

    tool: Tool
    plan: Array

    @property
    def size(self) -> int:
        return 9 * len(self.tool.components) + 1 + self.plan.size

    def bent(self, numbers: Array, shape: Callable[[Tool], Tool]) -> Candidate:
        """Make a candidate; ``shape`` makes its tool absurd."""
        count = len(self.tool.components)
        parts, heavier, ways = np.split(numbers, [9 * count, 9 * count + 1])
        sizes = {mount: np.zeros(3) for mount in self.tool.mounts}
        old = dict(sizes)
        bent: list[Component] = []
        for component, row in zip(self.tool.components, parts.reshape(count, 9), strict=True):
            size = np.clip(np.array(component.shape.size) * np.exp(_SIZE * row[:3]), 0.00051, rules.MAX_SIDE_M)
            old[component.name], sizes[component.name] = np.array(component.shape.size), size
            above, half = old[component.parent] / 2, old[component.name] / 2
            at, turn = component.pose.position, component.pose.rotation
            joint = np.clip(at, -above, above)  # the point of the parent nearest to the component's middle
            own = np.clip(turn.inv().apply(joint - at), -half, half)
            left = at + turn.apply(own) - joint  # a gap, if they don't quite touch
            turned = turn * Rotation.from_rotvec(_TURN_RAD * row[3:6])
            share = np.divide(joint, above, out=np.zeros(3), where=above > 0)
            joint = np.clip(share + _JOINT * row[6:9], -1, 1) * sizes[component.parent] / 2
            held = own / half * size / 2  # the same point, in the component
            position = joint + left - turned.apply(held)
            mass = float(component.mass * np.prod(size) / np.prod(old[component.name]) * np.exp(heavier[0]))
            pose = Pose.from_rotation(position, turned)
            bent.append(replace(component, pose=pose, shape=Box(tuple(size)), mass=mass))
        scale = np.array([_WAY_M] * 3 + [_WAY_RAD] * 3 + [_GRIP])[: self.plan.shape[1]]
        plan = self.plan + ways.reshape(self.plan.shape) * scale
        plan[:, 6:] = np.clip(plan[:, 6:], 0, 1)
        return Candidate(_heavy_enough(shape(replace(self.tool, components=tuple(bent)))), plan)


def random_start(task: Task, seed: int, random: np.random.Generator, *, flat: bool) -> Start:
    """Boxes in a chain, or on both fingers, and a way beside, through and on from a body that the goal names.

    With ``flat`` the last box is a sheet that sweeps low.
    """
    gripper = bool(random.random() < 0.25)
    parts: list[Component] = []
    if gripper:
        height, depth, thick = random.uniform(0.05, 0.25), random.uniform(0.01, 0.08), random.uniform(0.002, 0.015)
        for mount, side in zip(GRIPPER_MOUNTS, (1, -1), strict=True):
            pose = Pose(np.array([0.0, side * (thick / 2 + 0.001), 0.045 + height / 2]))
            parts.append(Component(f"{mount}_pad", mount, pose, Box((depth, thick, height))))
    else:
        length = random.uniform(0.05, 0.35)
        parts.append(Component("post", RIGID_MOUNT, Pose(np.array([0, 0, -length / 2])), Box((0.02, 0.02, length))))
        for number in range(int(random.integers(1, 4))):
            last = number == 2 or random.random() < 0.4
            thin = (flat and last) or random.random() < 0.4
            size = random.uniform(0.05, 0.35, 3) if thin else np.array([random.uniform(0.1, 0.6), 0.02, 0.02])
            size[2 if flat and last else int(random.integers(1, 3))] = 0.002 if thin else 0.02
            above = np.array(parts[-1].shape.size) / 2
            joint = np.array([0, 0, -above[2]]) if number == 0 else random.choice([-1, 0, 1], 3) * above
            own = np.array([-1, 0, -1]) if flat and last else random.choice([-1, 0, 1], 3)  # a sheet points ahead
            own = own * size / 2
            parts.append(Component(f"part_{number}", parts[-1].name, Pose(joint - own), Box(tuple(size))))
            if last:
                break
    tool = Tool(tuple(parts), gripper)
    tip = task.home.inverse().apply(robot_tracks(PANDA, tool, _still(at_home(task)))[-1].positions[0])
    goal, scene = task.goals[int(random.integers(len(task.goals)))], task.scene(seed)
    body = scene[str(random.choice(goal.bodies or [body.name for body in scene.bodies]))]
    start = body_tracks(Scene((body,)), PANDA, _still(at_home(task), Scene((body,))))
    low = min((track.low[0, 2] for track in start), default=body.pose.position[2])  # a fixed body has no track
    through = body.pose.position + random.normal(0, 0.02, 3)
    if flat or random.random() < 0.3:
        through[2] = low + random.uniform(0.001, 0.02)
    aside = np.append(random.normal(0, 1, 2) - (2.0 * flat, 0.0), 0.0)
    beside = through + aside / np.linalg.norm(aside) * random.uniform(0.1, 0.35)
    place = goal.place or tuple(body.pose.position + random.normal(0, 0.15, 3))
    end = np.array([through[i] if x is None else x for i, x in enumerate(place)]) + random.normal(0, 0.03, 3)
    up = np.array([0.0, 0.0, 0.2])
    targets = [beside + random.random() * up, beside, through, end, end][int(random.integers(2)) :]
    targets[-1] = targets[-1] + random.random() * up
    yaw, waypoints = random.normal(0, 0.2 if flat else 1.0), []
    for number, target in enumerate(targets):
        turn = task.home.rpy + random.normal(0, [0.1, 0.1, 0.2]) + np.array([0.0, 0.0, yaw])
        at = target - Rotation.from_euler("xyz", turn).apply(tip)
        waypoints.append([*at, *turn, *([float(number >= 2)] if gripper else [])])
    return Start(tool, np.array(waypoints))


def lightest(tool: Tool) -> Tool:
    """Make the tool as light as the rules allow."""
    volume = sum(component.shape.volume for component in tool.components)
    left = max(0.0, LIGHT * rules.MIN_TOOL_KG - len(tool.components) * LIGHT * rules.MIN_COMPONENT_KG)
    return _weighing(tool, [LIGHT * rules.MIN_COMPONENT_KG + left * c.shape.volume / volume for c in tool.components])


def _heavy_enough(tool: Tool) -> Tool:
    """Raise masses to what the rules allow."""
    masses = np.maximum([component.mass for component in tool.components], LIGHT * rules.MIN_COMPONENT_KG)
    return _weighing(tool, masses * max(1.0, LIGHT * rules.MIN_TOOL_KG / masses.sum()))


def _weighing(tool: Tool, masses: Sequence[float] | Array) -> Tool:
    pairs = zip(tool.components, masses, strict=True)
    return replace(tool, components=tuple(replace(component, mass=float(mass)) for component, mass in pairs))


def thinned(thickness: float) -> Callable[[Tool], Tool]:
    """Limit the least extent of every box."""

    def thin(tool: Tool) -> Tool:
        parts = []
        for component in tool.components:
            size = np.array(component.shape.size)
            size[size.argmin()] = min(size.min(), thickness)
            mass = component.mass * float(np.prod(size)) / component.shape.volume
            parts.append(replace(component, shape=Box(tuple(size)), mass=mass))
        return replace(tool, components=tuple(parts))

    return thin


# --- what is absurd ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Tried:
    """A rollout, and its scene and recording; ``commanded`` are the tool's solids if nothing held the arm back."""

    scene: Scene
    evaluation: Evaluation
    recording: Recording
    commanded: list[Track]
    bodies: list[Track]


def _nothing(_: Tried) -> float:
    return 0.0


def ghost(tried: Tried) -> float:
    """How far the plan is from commanding the tool into something fixed."""
    fixed = {body.name for body in tried.scene.bodies if body.fixed}
    return _lack(_deepest(tried.commanded, [t for t in tried.bodies if t.owner in fixed]), GHOST_M)


def fling(tried: Tried) -> float:
    """How far the tool's fastest point is from absurd speed."""
    travels = np.array([track.travel for track in tried.commanded])
    return _lack(float((travels[:, 2:] - travels[:, :-2]).max(initial=0.0)) * COMMANDED_HZ / 2, TIP_M_S)


def cut(tried: Tried) -> float:
    """How far the rollout is from a tool that has been inside of something (`inside`)."""
    assert tried.evaluation.candidate.tool is not None
    seen, every = tried.recording, max(1, round(1 / LOOKED_HZ / float(np.diff(tried.recording.times[:2])[0])))
    states = State(seen.states.names, *(array[::every] for array in seen.states.arrays))
    seen = Recording(seen.times[::every], seen.arm[::every], seen.fingers[::every], states)
    return _lack(inside(tried.scene, tried.evaluation.candidate.tool, seen)[0], INSIDE_CM2)


def floating(tried: Tried) -> float:
    """How far the end is from a body that hangs in the air (`hanging`)."""
    return _lack(hanging(tried.scene, tried.evaluation.candidate.tool, tried.recording)[0], AIR_M)


def early(tried: Tried) -> float:
    """How far a rollout is from a body that moved while the scene settled."""
    seen = tried.recording
    before = seen.states.positions[seen.times <= 0.0]
    moved = np.linalg.norm(before - before[:1], axis=-1).max(initial=0.0) if len(before) else 0.0
    return _lack(float(moved), EARLY_M)


def parted(tried: Tried) -> float:
    """How far a rollout is from a component that came away from its parent, by the gap between their solids."""
    tool = tried.evaluation.candidate.tool
    assert tool is not None
    solids = robot_tracks(PANDA, tool, tried.recording)
    loose = {component.name for component in tool.components if component.joint is not None}
    gaps = []
    for one in (solid for solid in solids if solid.name in loose):
        others = [other for other in solids if other.name != one.name]
        samples = range(0, len(tried.recording.times), 5)
        gaps += [min(_gap(one, one.at(k, 0.0)[0], other, k) for other in others) for k in samples]
    return _lack(max(gaps, default=0.0), PARTED_M)


def _lack(value: float, wanted: float) -> float:
    return max(0.0, 1 - value / wanted)


def _deepest(tool: Sequence[Track], bodies: Sequence[Track]) -> float:
    """The deepest that the tool's commanded path gets into bodies at their first poses, metres."""
    deepest, request = 0.0, coal.DistanceRequest()
    for one in tool:
        for other in bodies:
            near = ((one.low <= other.high[0]) & (one.high >= other.low[0])).all(axis=1)
            for k in np.flatnonzero(near[:-1]):
                for share in (0.0, 0.5):
                    here, there = one.at(int(k), share)[0], other.at(0, 0.0)[0]
                    gap = coal.distance(one.geometry, here, other.geometry, there, request, coal.DistanceResult())
                    deepest = max(deepest, -float(gap))
    return deepest


def inside(scene: Scene, tool: Tool, recording: Recording) -> tuple[float, str]:
    """The largest area, cm2, of a box's middle plane that is at once inside of one body; and where it is.

    Inside is what has the body all around it, `EATEN_M` in all six directions of the box, or less in thin bodies. Parts
    of a body that touch are one. This shares nothing with the check of penetration: it counts points.
    """
    worst = 0.0, ""
    own = [track for track in robot_tracks(PANDA, tool, recording) if isinstance(track.shape, Box)]
    for body in scene.bodies:
        parts = [track for track in body_tracks(scene, PANDA, recording) if track.owner == body.name]
        for one in own:
            near = [((one.low <= part.high) & (one.high >= part.low)).all(axis=1) for part in parts]
            margin = min(EATEN_M, 0.6 * min((part.half_width for part in parts), default=0.0))
            points, cell = _plane(one.shape)
            around = margin * np.vstack([np.eye(3), -np.eye(3)])
            for k in np.flatnonzero(np.any(near, axis=0)) if near else ():
                here = one.at(int(k), 0.0)[0]
                close = [part for part, there in zip(parts, near, strict=True) if there[k]]
                close = [part for part in close if _gap(one, here, part, int(k)) < 0]
                if not close:
                    continue
                left = points[_within(close, int(k), here, points)]
                for shift in around:
                    left = left[_within(close, int(k), here, left + shift)]
                area = 1e4 * cell * len(left)
                if area > worst[0]:
                    worst = area, f"{one.name} in {body.name} at {recording.times[k]:.2f} s"
    return worst


def _gap(one: Track, here: Any, part: Track, k: int) -> float:
    there = part.at(k, 0.0)[0]
    return float(coal.distance(one.geometry, here, part.geometry, there, coal.DistanceRequest(), coal.DistanceResult()))


def _within(parts: Sequence[Track], k: int, here: Any, points: Array) -> Any:
    """Report whether points (P, 3) of a solid at ``here`` are in one of the parts."""
    world = points @ here.getRotation().T + here.getTranslation()
    return np.any([_contains(part, k, world) for part in parts], axis=0)


def _plane(shape: Box) -> tuple[Array, float]:
    """Points (P, 3) of a box's middle plane across its least extent, and the area of each, m2."""
    size = np.array(shape.size)
    thin = int(size.argmin())
    counts = np.clip(np.ceil(size / 0.0025), 1, 40).astype(int)
    counts[thin] = 1
    axes = [(np.arange(n) + 0.5) / n * side - side / 2 for n, side in zip(counts, size, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return points, float(np.prod(np.delete(size, thin))) / len(points)


def _contains(part: Track, k: int, points: Array) -> Any:
    """Report whether points (P, 3) of the world are in a body's part."""
    there = part.at(k, 0.0)[0]
    x = (points - there.getTranslation()) @ there.getRotation()
    match part.shape:
        case Box(size):
            return (np.abs(x) < np.array(size) / 2).all(axis=1)
        case Sphere(radius):
            return np.linalg.norm(x, axis=1) < radius
        case Cylinder(radius, length):
            return (np.hypot(x[:, 0], x[:, 1]) < radius) & (np.abs(x[:, 2]) < length / 2)
        case Mesh():
            faces = _faces(part.shape.vertices.tobytes())
            return (x @ faces[:, :3].T + faces[:, 3] < 0).all(axis=1)
    return np.zeros(len(x), dtype=bool)


@lru_cache(maxsize=512)
def _faces(vertices: bytes) -> Array:
    """The planes (F, 4) of a hull."""
    faces: Array = ConvexHull(np.frombuffer(vertices).reshape(-1, 3)).equations
    return faces


def hanging(scene: Scene, tool: Tool | None, recording: Recording) -> tuple[float, str]:
    """How far, metres, a lifted body at rest reaches beyond all that supports it at the end; and its name.

    What supports it are the boxes around the places where something below touches it. A body held from two sides is
    not counted. A lifted body that nothing touches hangs by a metre.
    """
    assert tool is not None
    states, tracks = recording.states, body_tracks(scene, PANDA, recording)
    solids = [*robot_tracks(PANDA, tool, recording), *tracks]
    worst = 0.0, ""
    for body in scene.free:
        first, last = states[0].position(body.name), states[-1].position(body.name)
        still = np.linalg.norm(states[-1].linear_velocity(body.name)) < _AT_REST_M_S
        if not still or last[2] < first[2] + _LIFTED_M or last[2] < -0.2:
            continue
        middle = states[-1].pose(body.name).apply(_center(body))[:2]
        own, others = [t for t in tracks if t.owner == body.name], [t for t in solids if t.owner != body.name]
        low, high, normals = np.full(2, np.inf), np.full(2, -np.inf), []
        for one in own:
            for other in others:
                touch = np.maximum(one.low[-1], other.low[-1]), np.minimum(one.high[-1], other.high[-1])
                if (touch[0] > touch[1] + _TOUCH_M).any():
                    continue
                result, k = coal.DistanceResult(), len(recording.times) - 1
                here, there = one.at(k, 0.0)[0], other.at(k, 0.0)[0]
                gap = coal.distance(other.geometry, there, one.geometry, here, coal.DistanceRequest(), result)
                if gap > _TOUCH_M:
                    continue
                normals.append(result.normal)
                if result.normal[2] > 0.2:
                    low, high = np.minimum(low, touch[0][:2]), np.maximum(high, touch[1][:2])
        if any(a @ b < -0.5 for i, a in enumerate(normals) for b in normals[:i]):
            continue
        beyond = np.maximum(np.maximum(low - middle, middle - high), 0.0)
        worst = max(worst, (min(float(np.linalg.norm(beyond)), 1.0), body.name))
    return worst


def _center(body: Body) -> Array:
    return body.inertia().frame.position


# --- trying -----------------------------------------------------------------------------------------------------


class Watched(Simulator):
    """A simulator whose last jobs and outcomes can be read."""

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator
        self.jobs: Sequence[Rollout] = ()
        self.outcomes: list[Outcome] = []

    def rollout(self, task: Task, jobs: Sequence[Rollout]) -> list[Outcome]:
        self.jobs, self.outcomes = jobs, self.simulator.rollout(task, jobs)
        return self.outcomes

    def render(self, task: Task, **options: Any) -> Any:
        return self.simulator.render(task, **options)


def tried(scene: Scene, evaluation: Evaluation, job: Rollout, recording: Recording) -> Tried:
    """Follow the commanded path of a rollout's tool."""
    assert evaluation.candidate.tool is not None
    tool, still = evaluation.candidate.tool, _still(job.trajectory, scene)
    loose = np.zeros((len(still.times), len(tool.bearers)))  # the tool's own joints stay as they were built
    held = replace(still, fingers=np.hstack([still.fingers, loose]))
    commanded = robot_tracks(PANDA, tool, held)[-len(tool.components) :]
    return Tried(scene, evaluation, recording, commanded, body_tracks(scene, PANDA, still))


def _still(trajectory: JointTrajectory, scene: Scene = _EMPTY) -> Recording:
    """A recording in which the robot follows a trajectory exactly, and nothing else moves."""
    times = np.arange(max(2, round(COMMANDED_HZ * trajectory.duration))) / COMMANDED_HZ
    arm, fingers = trajectory.sample(times)
    return Recording(times, arm, np.stack([fingers] * 2, axis=1), State.stack([scene.state()] * len(times)))


@dataclass(frozen=True)
class Objective:
    """``shape`` makes every tool absurd, ``lack`` (0: none) says how far a rollout is from it."""

    shape: Callable[[Tool], Tool]
    lack: Callable[[Tried], float]
    says: str
    flat: bool = False


def _as_it_is(tool: Tool) -> Tool:
    return tool


OBJECTIVES = {
    "gram": Objective(lightest, _nothing, "the tool weighs a gram, the least that the rules allow"),
    "sheet": Objective(thinned(SHEET_M), _nothing, "every box is thinner than 1 mm", flat=True),
    "inside": Objective(thinned(BLADE_M), cut, "boxes of at most 2 mm, 1 cm2 of one inside of something", flat=True),
    "ghost": Objective(_as_it_is, ghost, "the plan leads the tool 8 mm or deeper into something fixed"),
    "fling": Objective(_as_it_is, fling, "a point of the tool is faster than 6 m/s"),
    "float": Objective(_as_it_is, floating, "a lifted body ends 2 cm or more beyond what supports it"),
}

"""Measure how far a rollout is from an absurd one: 0 where it is, and up to 1. Used by `tests.benchmarks.cheats`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import coal
import numpy as np
from scipy.spatial import ConvexHull

from core.design import Tool
from core.geometry import Array, Box, Shape
from core.interfaces import (
    JointTrajectory,
    Outcome,
    Recording,
    Rollout,
    Simulator,
    Task,
)
from core.scene import Filling, Scene, State
from core.solids.tracks import Track
from core.trial import Evaluation
from plugins.results.workshop.tracks import body_tracks, robot_tracks
from tests.support.panda import PANDA

# From here on a tool, a motion or an end counts as absurd.
PARTED_M = 0.005
HOME_RAD = 0.02
PRESSED_N = 60.0
FAST_M_S = 0.2
GHOST_M = 0.008
TIP_M_S = 6.0
INSIDE_CM2 = 1.0
# Of what is commanded, and of what is looked at.
COMMANDED_HZ = 25.0
LOOKED_HZ = 50.0
EATEN_M = 0.003
IDLE_S = 0.5
SUNK_M = 0.012


@dataclass(frozen=True)
class Tried:
    """A rollout, and its scene and recording; ``commanded`` are the tool's solids if nothing held the arm back."""

    scene: Scene
    evaluation: Evaluation
    recording: Recording
    commanded: list[Track]
    bodies: list[Track]


def ghost(tried: Tried) -> float:
    """How far the plan is from commanding the tool into something fixed."""
    fixed = {body.name for body in tried.scene.bodies if body.fixed}
    return _lack(
        _deepest(tried.commanded, [t for t in tried.bodies if t.owner in fixed]),
        GHOST_M,
    )


def fling(tried: Tried) -> float:
    """How far the tool's fastest point is from absurd speed."""
    travels = np.array([track.travel for track in tried.commanded])
    return _lack(
        float((travels[:, 2:] - travels[:, :-2]).max(initial=0.0)) * COMMANDED_HZ / 2,
        TIP_M_S,
    )


def cut(tried: Tried) -> float:
    """How far the rollout is from a tool that has been inside of something (`inside`)."""
    assert tried.evaluation.candidate.tool is not None
    seen = tried.recording
    every = max(1, round(1 / LOOKED_HZ / float(np.diff(tried.recording.times[:2])[0])))
    states = State(seen.states.names, *(array[::every] for array in seen.states.arrays))
    seen = Recording(
        seen.times[::every], seen.arm[::every], seen.fingers[::every], states
    )
    return _lack(
        inside(tried.scene, tried.evaluation.candidate.tool, seen)[0], INSIDE_CM2
    )


def parted(tried: Tried) -> float:
    """How far a rollout is from a component that came away from its parent, by the gap between their solids."""
    tool = tried.evaluation.candidate.tool
    assert tool is not None
    solids = robot_tracks(PANDA, tool, tried.recording)
    loose = {
        component.name for component in tool.components if component.joint is not None
    }
    gaps = []
    for one in (solid for solid in solids if solid.name in loose):
        others = [other for other in solids if other.name != one.name]
        samples = range(0, len(tried.recording.times), 5)
        gaps += [
            min(_gap(one, one.at(k), other, k) for other in others) for k in samples
        ]
    return _lack(max(gaps, default=0.0), PARTED_M)


def still(tried: Tried) -> float:
    """How far the arm goes from home, which it is told not to leave."""
    arm = tried.recording.arm
    return min(1.0, max(0.0, float(np.abs(arm - arm[0]).max()) - HOME_RAD))


def pressed(tried: Tried) -> float:
    """How far something fixed is from bearing a large force through a free body, besides its weight."""
    fixed = {body.name for body in tried.scene.bodies if body.fixed}
    free = {body.name for body in tried.scene.free}
    through = [
        force - force[0]
        for pair, force in tried.recording.forces.items()
        if (pair[0] in fixed and pair[1] in free)
        or (pair[1] in fixed and pair[0] in free)
    ]
    return max(
        0.0,
        1 - max((float(np.max(force)) for force in through), default=0.0) / PRESSED_N,
    )


def moving(tried: Tried) -> float:
    """How far the fastest free body is from moving at the end, when rewards are judged."""
    speeds = np.linalg.norm(tried.recording.states.arrays[2][-1], axis=-1)
    return max(0.0, 1 - float(speeds.max(initial=0.0)) / FAST_M_S)


def anything(_: Tried) -> float:
    """Let a person look at all that earns: for searches that start from an attack, and not from honest work."""
    return 0.0


def idle(tried: Tried) -> float:
    """How long the robot's moving parts are beside a free body, by the boxes around them: work needs a touch."""
    free = {body.name for body in tried.scene.free}
    tool = tried.evaluation.candidate.tool
    assert tool is not None
    seen = tried.recording
    solids = robot_tracks(PANDA, tool, seen)
    beside = np.zeros(len(seen.times) - 1, dtype=bool)
    for part in body_tracks(tried.scene, PANDA, seen):
        if part.owner in free:
            for solid in solids:
                met = (solid.low <= part.high) & (solid.high >= part.low)
                beside |= met.all(axis=1)[: len(beside)]
    for nodes in seen.states.soft.values():
        for solid in solids:
            met = (solid.low[: len(beside)] <= nodes.max(axis=1)[:-1]) & (
                solid.high[: len(beside)] >= nodes.min(axis=1)[:-1]
            )
            beside |= met.all(axis=1)
    touched = np.diff(seen.times)[beside[: len(seen.times) - 1]].sum()
    return min(1.0, float(touched) / IDLE_S)


def sunk(tried: Tried) -> float:
    """How far the tool is from being in a soft body: its corners in the body's hull, or an element's middle in it.

    This shares nothing with the checks: it counts neither faces nor barycentric shares.
    """
    tool = tried.evaluation.candidate.tool
    assert tool is not None
    deepest = 0.0
    solids = robot_tracks(PANDA, tool, tried.recording)[-len(tool.components) :]
    for soft in tried.scene.softs:
        nodes = tried.recording.states.nodes(soft.name)
        for solid in solids:
            low, high = nodes.min(axis=1), nodes.max(axis=1)
            near = (solid.low <= high[: len(solid.low)]).all(axis=1)
            near &= (solid.high >= low[: len(solid.high)]).all(axis=1)
            for k in np.flatnonzero(near).tolist():
                deepest = max(deepest, _sinks(soft.form, nodes[k], solid, k))
    return _lack(deepest, SUNK_M)


def _sinks(form: Any, nodes: Array, solid: Track, k: int) -> float:
    """How deep a solid and a soft body are in each other at a sample, metres."""
    there = solid.at(k)
    rotation, origin = there.getRotation(), there.getTranslation()
    if isinstance(form, Filling):
        points = solid.shape.to_trimesh().vertices @ rotation.T + origin
        faces = ConvexHull(nodes).equations
    else:
        middles = nodes[form.elements].mean(axis=1)
        points = (middles - origin) @ rotation
        faces = _faces(solid.shape)
    inside = -(points @ faces[:, :3].T + faces[:, 3]).max(axis=1)
    return float(inside.max(initial=0.0))


def _lack(value: float, wanted: float) -> float:
    return max(0.0, 1 - float(value) / wanted)


def _deepest(tool: Sequence[Track], bodies: Sequence[Track]) -> float:
    """The deepest that the tool's commanded path gets into bodies at their first poses, metres."""
    deepest = 0.0
    request = coal.DistanceRequest()
    for one in tool:
        for other in bodies:
            near = ((one.low <= other.high[0]) & (one.high >= other.low[0])).all(axis=1)
            for k in np.flatnonzero(near[:-1]):
                for share in (0.0, 0.5):
                    here = one.at(int(k) + share)
                    there = other.at(0)
                    gap = coal.distance(
                        one.geometry,
                        here,
                        other.geometry,
                        there,
                        request,
                        coal.DistanceResult(),
                    )
                    deepest = max(deepest, -float(gap))
    return deepest


def inside(scene: Scene, tool: Tool, recording: Recording) -> tuple[float, str]:
    """The largest area, cm2, of a box's middle plane that is at once inside of one body; and where it is.

    Inside is what has the body all around it, `EATEN_M` in all six directions of the box, or less in thin bodies. Parts
    of a body that touch are one. This shares nothing with the check of penetration: it counts points.
    """
    worst = 0.0, ""
    own = [
        track
        for track in robot_tracks(PANDA, tool, recording)
        if isinstance(track.shape, Box)
    ]
    for body in scene.bodies:
        parts = [
            track
            for track in body_tracks(scene, PANDA, recording)
            if track.owner == body.name
        ]
        for one in own:
            near = [
                ((one.low <= part.high) & (one.high >= part.low)).all(axis=1)
                for part in parts
            ]
            halves = [part.shape.thickness / 2 for part in parts]
            margin = min(EATEN_M, 0.6 * min(halves, default=0.0))
            points, cell = _plane(one.shape)
            around = margin * np.vstack([np.eye(3), -np.eye(3)])
            for k in np.flatnonzero(np.any(near, axis=0)) if near else ():
                here = one.at(int(k))
                close = [
                    part for part, there in zip(parts, near, strict=True) if there[k]
                ]
                close = [part for part in close if _gap(one, here, part, int(k)) < 0]
                if not close:
                    continue
                left = points[_within(close, int(k), here, points)]
                for shift in around:
                    left = left[_within(close, int(k), here, left + shift)]
                area = 1e4 * cell * len(left)
                if area > worst[0]:
                    worst = (
                        area,
                        f"{one.name} in {body.name} at {recording.times[k]:.2f} s",
                    )
    return worst


def _gap(one: Track, here: Any, part: Track, k: int) -> float:
    there = part.at(k)
    return float(
        coal.distance(
            one.geometry,
            here,
            part.geometry,
            there,
            coal.DistanceRequest(),
            coal.DistanceResult(),
        )
    )


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
    axes = [
        (np.arange(n) + 0.5) / n * side - side / 2
        for n, side in zip(counts, size, strict=True)
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return points, float(np.prod(np.delete(size, thin))) / len(points)


def _contains(part: Track, k: int, points: Array) -> Any:
    """Report whether points (P, 3) of the world are in a body's part."""
    there = part.at(k)
    local = (points - there.getTranslation()) @ there.getRotation()
    faces = _faces(part.shape)
    return (local @ faces[:, :3].T + faces[:, 3] < 0).all(axis=1)


@lru_cache(maxsize=512)
def _faces(shape: Shape) -> Array:
    """The planes (F, 4) of a convex shape."""
    faces: Array = ConvexHull(shape.to_trimesh().vertices).equations
    return faces


# --- trying -----------------------------------------------------------------------------------------------------


class Watched(Simulator):
    """A simulator whose last jobs and outcomes can be read."""

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator
        self.supports = simulator.supports
        self.jobs: Sequence[Rollout] = ()
        self.outcomes: list[Outcome] = []

    def rollout(self, task: Task, jobs: Sequence[Rollout]) -> list[Outcome]:
        self.jobs, self.outcomes = jobs, self.simulator.rollout(task, jobs)
        return self.outcomes

    def render(self, task: Task, **options: Any) -> Any:
        return self.simulator.render(task, **options)


def tried(
    scene: Scene, evaluation: Evaluation, job: Rollout, recording: Recording
) -> Tried:
    """Follow the commanded path of a rollout's tool."""
    assert evaluation.candidate.tool is not None
    tool = evaluation.candidate.tool
    still = _still(job.trajectory, scene)
    # The tool's own joints stay as they were built.
    loose = np.zeros((len(still.times), len(tool.bearers)))
    held = replace(still, fingers=np.hstack([still.fingers, loose]))
    commanded = robot_tracks(PANDA, tool, held)[-len(tool.components) :]
    return Tried(
        scene, evaluation, recording, commanded, body_tracks(scene, PANDA, still)
    )


def _still(trajectory: JointTrajectory, scene: Scene) -> Recording:
    """A recording in which the robot follows a trajectory exactly, and nothing else moves."""
    times = np.arange(max(2, round(COMMANDED_HZ * trajectory.duration))) / COMMANDED_HZ
    arm, fingers = trajectory.sample(times)
    return Recording(
        times,
        arm,
        np.stack([fingers] * 2, axis=1),
        State.stack([scene.state()] * len(times)),
    )


MEASURES: dict[str, Callable[[Tried], float]] = {
    "still": still,
    "parted": parted,
    "pressed": pressed,
    "moving": moving,
    "ghost": ghost,
    "fling": fling,
    "inside": cut,
    "idle": idle,
    "sunk": sunk,
    "anything": anything,
}

EVERYWHERE = [name for name in MEASURES if name not in ("idle", "sunk", "anything")]
"""What is looked for unless measures are named; the others are for scenes with soft bodies, or for known attacks."""

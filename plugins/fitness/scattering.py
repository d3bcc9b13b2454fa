"""Perturb a scene: move its free bodies a little, and change masses and friction."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.sparse.csgraph import connected_components

from core.geometry import Pose
from core.robot.solids import Obstacles, Solid, body_solids, signed_distance
from core.scene import Body, Scene
from plugins.fitness.perturbation_range import PerturbationRange

TOGETHER_M = 0.0015  # free bodies nearer to each other than this are moved as one
CLEAR_M = 0.0002  # the clearance that a move leaves, or what there was if that is less
CONTACT_M = 0.0005  # bodies nearer than this stay as near: a body keeps its support

_EXACT_M = 2e-5  # accuracy of Coal's distances between convex shapes that touch
_TRIES = 32  # for each size of the change; then it is halved
_HALVINGS = 6


def perturb(scene: Scene, ranges: PerturbationRange, draw: int) -> Scene:
    """Perturb a scene; the same ``draw`` number (0 or greater) gives the same perturbation.

    Each body's mass and friction change independently, sliding and rolling friction by the same share. A free body
    moves on the level it stands on, together with the free bodies that it touches or nearly touches (a pot with what
    lies in it, a row of books). It neither penetrates anything nor loses a contact; where room is scarce a move is
    drawn again, and smaller. Fixed bodies and marks stay, since rewards name places in the world, and so do bodies that
    hang from them or from the world; those that hang from a free one move with it.
    """
    rng = np.random.default_rng([draw, 0])
    scales = rng.uniform(-1, 1, (len(scene.bodies), 2)).tolist()
    poses = _draw_poses(scene, ranges, np.random.default_rng([draw, 1]))

    bodies: list[Body] = []
    for body, (heavier, rougher) in zip(scene.bodies, scales, strict=True):
        friction = 1 + ranges.friction * rougher
        changed = replace(
            body,
            pose=poses.get(body.name, body.pose),
            mass=body.mass * (1 + ranges.mass * heavier),
            friction=body.friction * friction,
            rolling_friction=body.rolling_friction * friction,
        )
        bodies.append(changed)

    return replace(scene, bodies=tuple(bodies))


def _draw_poses(
    scene: Scene, ranges: PerturbationRange, rng: np.random.Generator
) -> dict[str, Pose]:
    """Draw new poses of free bodies, by name."""
    poses: dict[str, Pose] = {}
    if ranges.position == ranges.yaw == 0:
        return poses

    solids = {body.name: tuple(body_solids(body)) for body in scene.bodies}
    anchored = {body.name for body in scene.bodies if body.fixed} | {None}

    for placed in scene.ordered_joints:
        if placed.joint.parent in anchored:
            anchored.add(placed.joint.body)

    loose = [
        body for body in scene.free if body.name not in anchored and body.collisions
    ]
    for group in together(loose, solids, scene.joined):
        members = {body.name for body in group}
        moving: list[Solid] = []
        standing: list[Solid] = []
        for name, parts in solids.items():
            if name not in members:
                standing += parts

        for body in group:
            moving += solids[body.name]

        move = _draw_move(group, moving, Obstacles(standing), ranges, rng)

        for body in group:
            poses[body.name] = move @ body.pose
            parts = solids[body.name]
            solids[body.name] = tuple(_move(solid, move) for solid in parts)

    return poses


def together(
    bodies: Sequence[Body],
    solids: Mapping[str, Sequence[Solid]],
    joined: Collection[frozenset[str]] = (),
) -> list[list[Body]]:
    """Group bodies that touch or nearly touch, or are joined, directly or through others.

    Groups are ordered by their first body.
    """
    near = np.zeros((len(bodies), len(bodies)), dtype=bool)
    for i, body in enumerate(bodies):
        for j in range(i):
            others = Obstacles(solids[bodies[j].name])
            near[i, j] = frozenset((body.name, bodies[j].name)) in joined or any(
                signed_distance(solid, other) < TOGETHER_M
                for solid in solids[body.name]
                for other in others.near(solid, TOGETHER_M)
            )

    count, labels = connected_components(near, directed=False)
    return [
        [body for body, label in zip(bodies, labels, strict=True) if label == group]
        for group in range(count)
    ]


def _move(solid: Solid, move: Pose) -> Solid:
    return replace(solid, pose=move @ solid.pose)


def _draw_move(
    group: Sequence[Body],
    solids: Sequence[Solid],
    others: Obstacles,
    ranges: PerturbationRange,
    rng: np.random.Generator,
) -> Pose:
    """Draw a move of a group as a whole, in the world, about the mean of its positions; no move if nothing fits."""
    middle = np.mean([body.pose.position for body in group], axis=0)
    middle = middle * np.array([1.0, 1.0, 0.0])
    most = (ranges.position, ranges.position, ranges.yaw)
    before = _gaps(solids, others)
    for halvings in range(_HALVINGS):
        for _ in range(_TRIES):
            x, y, yaw = rng.uniform(-1, 1, 3) * most * 0.5**halvings
            turned = Pose.xyz_rpy(middle + np.array([x, y, 0.0]), (0.0, 0.0, yaw))
            move = turned @ Pose(-middle)
            after = _gaps([_move(solid, move) for solid in solids], others)
            if _fits(before, after):
                return move

    return Pose()


def _gaps(solids: Sequence[Solid], others: Obstacles) -> dict[str, float]:
    """Measure the distance to each other body that is near, by name, metres."""
    gaps: dict[str, float] = {}
    for solid in solids:
        for other in others.near(solid, CLEAR_M):
            gap = signed_distance(solid, other)
            gaps[other.name] = min(gap, gaps.get(other.name, math.inf))

    return gaps


def _fits(before: Mapping[str, float], after: Mapping[str, float]) -> bool:
    """Check that nothing is too near and that no contact is lost."""
    far = math.inf
    free = all(
        gap >= min(before.get(name, far), CLEAR_M) - _EXACT_M
        for name, gap in after.items()
    )
    held = all(
        after.get(name, far) < CONTACT_M + _EXACT_M
        for name, gap in before.items()
        if gap < CONTACT_M
    )
    return free and held

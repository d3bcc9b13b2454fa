"""Cages for bodies that move when the motion begins."""

from __future__ import annotations

import numpy as np

from core.geometry import Cylinder, Pose, Sphere
from plugins.vlms.offline.heads import Head, cage
from plugins.vlms.offline.plans import Path
from plugins.vlms.offline.scene_analysis import Errand, Thing
from plugins.vlms.offline.tines import enter


def _slowing(thing: Thing) -> float:
    """Estimate how fast a body slows down that rolls, or slides if it can't, m/s2."""
    body, radius = thing.body, float(np.ptp(thing.points[:, 2])) / 2
    rolls = any(isinstance(part.shape, Sphere | Cylinder) for part in body.collisions)
    arm = 5 / 7 * body.rolling_friction / radius
    return 9.81 * max(arm if rolls else np.sqrt(0.5 * body.friction), 1e-4)


def catcher(errand: Errand, rng: np.random.Generator) -> Head:
    """A cage, open to what comes, put in its way before it gets there; what was caught is then moved to the goal."""
    bodies = [thing.body for thing in errand.things if thing.body.launched]
    velocities = np.array([body.velocity for body in bodies]) * [1.0, 1.0, 0.0]
    positions = np.array([body.pose.position for body in bodies])
    way = velocities.mean(axis=0) / max(float(np.linalg.norm(velocities.mean(axis=0))), 1e-6)
    heading = float(np.arctan2(-way[1], -way[0]))
    side = np.array([-way[1], way[0], 0.0])
    speeds = np.maximum(velocities @ way, 0.02)
    slowing = np.array([_slowing(thing) for thing in errand.things if thing.body.launched])
    wanted = errand.shift @ way if errand.length > 0.01 else 0.0
    sizes = float(np.ptp(errand.things[0].points @ way)) / 2
    distance = np.maximum(wanted + (positions @ way).mean() - positions @ way, 0.0)
    if float((distance / speeds).min()) < 1.5:
        distance = distance + 1.5 * speeds.max()
    distance = np.minimum(distance + rng.normal(0.0, 0.03), 0.8 * speeds**2 / (2 * slowing))
    times = (speeds - np.sqrt(np.maximum(speeds**2 - 2 * slowing * distance, 0.0))) / slowing
    meet = float((positions @ way + distance).mean())
    across = positions @ side
    width = float(np.ptp(across)) + 2 * sizes + rng.uniform(0.02, 0.08)
    height = float(np.clip(np.ptp(errand.points[:, 2]) * rng.uniform(0.6, 1.2), 0.02, 0.15))
    depth = 2 * sizes * rng.uniform(0.8, 2.5)
    face = (meet + sizes) * way + (across.min() + across.max()) / 2 * side
    face[2] = float(errand.lower[2]) + rng.uniform(0.002, 0.008)
    late = float(times.max()) + rng.uniform(0.3, 1.5)
    left = (errand.shift - distance.mean() * way) * np.array([1.0, 1.0, 0.0])
    rest = left - max(float(left @ way), 0.0) * way  # the opening is ahead

    def along(path: Path, rng: np.random.Generator) -> str:
        enter(path, errand, Pose.xyz_rpy(face, (0.0, 0.0, heading)))
        for _ in range(int(np.clip(np.ceil((late - 1.5) / 0.5), 1, 30))):
            path.go(face, heading, touch=True)
        path.hold()
        if np.linalg.norm(rest) > 0.02:
            path.stroke(face + rest, heading, 0.1)
            path.go(face + rest, heading, touch=True)
        ahead = meet - (positions @ way).mean()
        return f"waits for {late:.1f} s with a cage, open to what comes, {ahead:.2f} m ahead of it"

    made = cage(width, depth, height, float(rng.uniform(0.005, 0.01)), float(rng.uniform(0.0, 0.3)))
    return Head("catcher", "guided", made.pieces, made.hold, depth, width, way=along)

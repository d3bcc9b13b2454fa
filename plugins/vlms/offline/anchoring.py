"""Choose what a plan's waypoints stand by, so that the plan works in other layouts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from core.geometry import Pose
from core.interfaces import Anchor, Seen
from plugins.vlms.offline.plans import Path
from plugins.vlms.offline.scene_analysis import Errand, Sight

_APART_M = 0.03  # two bodies that are nearer give no direction


def anchors_of(path: Path, errands: Sequence[Errand], sight: Sight, rng: np.random.Generator) -> list[Anchor]:
    """Choose an anchor for each waypoint of a path through the errands.

    Until the bodies are moved it is by them, or by what contains them; then it goes over to where the goal wants them.
    """
    positions, found = np.array([pose.position for pose in path.poses]), []
    first = 0
    for errand, (last, contact) in zip(errands, path.ends, strict=False):
        base, goal = _base(errand, sight, rng), errand.at
        shares = np.zeros(last - first)
        if goal is not None and goal != base.name and errand.length > _APART_M:
            along = (positions[first:last] - positions[contact]) @ (errand.shift * [1.0, 1.0, 0.0]) / errand.length
            shares = np.clip(along / max(float(along.max()), errand.length), 0.0, 1.0).round(3)
            shares[: contact - first] = 0.0
        for share in shares.tolist():
            toward = goal if goal is not None and (share or base.toward) else base.toward
            found.append(replace(base, toward=toward, share=share))
        first = last
    return found


def turn_of(sight: Sight, seen: Seen) -> Pose | None:
    """Compute a turn about the robot after which the axes of what the bodies are taken by are the world's.

    None: they are not taken along its axes, or there is nothing to turn.
    """
    goal = sight.goals[0]
    things = [sight.things[sight.names.index(name)] for name in goal.bodies]
    name = sight.container(things[:1] if goal.any else things)
    if name is None and len(things) == 1 and sight.at[0] in (None, goal.bodies[0]):
        (name,) = goal.bodies
    yaw = 0.0 if name is None else -float(seen.poses[name].rpy[2])
    base = Pose(sight.space.base)
    return base @ Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, yaw)) @ base.inverse() if yaw else None


def _base(errand: Errand, sight: Sight, rng: np.random.Generator) -> Anchor:
    """Choose the frame in which the bodies are taken."""
    container = sight.container(errand.things)
    if container is not None:
        return Anchor(container, axes="anchor")
    if len(errand.things) > 1:  # they are scattered otherwise in each layout
        return Anchor(toward=errand.at or "")
    (name,) = (sight.name(thing) for thing in errand.things)
    away = errand.at is not None and errand.at != name and errand.length > _APART_M
    if errand.at in sight.names:  # it may be below
        apart = sight.things[sight.names.index(errand.at)].position - errand.things[0].position
        away = away and float(np.hypot(*apart[:2])) > _APART_M
    if away and (errand.alone or rng.random() < 0.8):
        return Anchor(name, toward=errand.at or "")
    return Anchor(name, axes="anchor")

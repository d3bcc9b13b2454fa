"""Choose what the waypoints of a path stand by, so that a plan moves with the layout."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from core.geometry import Array, Pose
from core.interfaces import Anchor, Seen
from plugins.vlms.offline.boxes import LEVEL
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.scene_analysis import SceneAnalysis
from plugins.vlms.offline.subgoals import Subgoal

# How often a body apart from its goal gives the direction of the way there.
_TOWARD = 0.8
_APART_M = 0.03  # two bodies that are nearer give no direction


def choose_anchors(
    path: HeadPath,
    subgoals: Sequence[Subgoal],
    rng: Generator,
) -> list[Anchor]:
    """Choose an anchor for each waypoint of a path through the subgoals.

    Until the bodies are moved it is by them, or by what contains them; then it goes over to where the goal wants them.

    Args:
        path: with a stage for each subgoal, or one for all of them.
        subgoals: in the order of the stages.
        rng: random numbers of anchors alone.
    """
    positions = np.array([pose.position for pose in path.poses])
    anchors = []
    first = 0

    for subgoal, stage in zip(subgoals, path.stages, strict=False):
        base = _choose_base(subgoal, rng)
        goal = subgoal.reference
        shares = np.zeros(stage.end - first)
        if goal is not None and goal != base.name and subgoal.length > _APART_M:
            ways = positions[first : stage.end] - positions[stage.contact]
            shares = _share_of_way(ways, subgoal)
            shares[: stage.contact - first] = 0.0

        for share in shares.tolist():
            toward = base.toward
            if goal is not None and (share or base.toward):
                toward = goal

            anchors.append(replace(base, toward=toward, share=share))

        first = stage.end

    return anchors


def _share_of_way(ways: Array, subgoal: Subgoal) -> Array:
    """Compute how much of the way to the goal the head has gone, 0..1, (N,), from its ways (N, 3).

    The way to the goal is the subgoal's shift on the ground, or as far as the head goes along it.

    Args:
        ways: of the head since the bodies are moved, (N, 3), metres.
        subgoal: with a shift on the ground.
    """
    along = ways @ (subgoal.shift * LEVEL) / subgoal.length
    whole = max(along.max(), subgoal.length)
    return np.asarray(np.clip(along / whole, 0.0, 1.0).round(3))


def _choose_base(subgoal: Subgoal, rng: Generator) -> Anchor:
    """Choose the frame in which the bodies are taken.

    A container's own axes are taken. Scattered bodies are taken where they are in the world, on the way to the goal; a
    body alone by itself, with its own axes or those toward the goal.

    Args:
        subgoal: the bodies.
        rng: random numbers.
    """
    container = subgoal.model.find_container(subgoal.solids)
    if container is not None:
        return Anchor(container, axes="anchor")

    reference = subgoal.reference or ""
    if len(subgoal.solids) > 1:  # they are scattered otherwise in each layout
        return Anchor(toward=reference)

    (solid,) = subgoal.solids
    name = solid.body.name
    if _is_apart(subgoal) and (subgoal.alone or rng.random() < _TOWARD):
        return Anchor(name, toward=reference)

    return Anchor(name, axes="anchor")


def _is_apart(subgoal: Subgoal) -> bool:
    """Report whether the way from a subgoal's only body to what its goal stands by gives a direction.

    A reference that is a solid must also be beside the body, not only above or below it.
    """
    (solid,) = subgoal.solids
    if subgoal.reference in (None, solid.body.name) or subgoal.length <= _APART_M:
        return False

    reference = subgoal.model.solids.get(subgoal.reference or "")
    if reference is None:  # a mark
        return True

    way = reference.position - solid.position  # it may be below
    return float(np.hypot(*way[:2])) > _APART_M


def find_turn(analysis: SceneAnalysis, seen: Seen) -> Pose | None:
    """Find the turn about the robot after which the axes of what the bodies are taken by are the world's.

    None: they are not taken along its axes, or there is nothing to turn.

    Args:
        analysis: of the layout that plans are made for.
        seen: the poses in it.
    """
    goal = analysis.groups[0][0]
    solids = [analysis.model.solids[name] for name in goal.bodies]
    name = analysis.model.find_container(solids[:1] if goal.any else solids)
    if name is None and len(solids) == 1 and goal.reference in (None, goal.bodies[0]):
        (name,) = goal.bodies
    if name is None:
        return None

    yaw = -seen.poses[name].rpy[2]
    if not yaw:
        return None

    base = Pose(analysis.model.workspace.base)
    return base @ Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, yaw)) @ base.inverse()

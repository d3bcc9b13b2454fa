"""Find what is wrong with a tool and its plan: broken rules, what the arm doesn't reach, what it meets on its way."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Any, NamedTuple

import coal
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation, Slerp

from core.design import DesignError, Tool
from core.designs.rules import check_tool
from core.geometry import Array, step_lengths
from core.interfaces import JointTrajectory
from core.robot.kinematics import arm_of, open_mounts
from core.robot.solids import Obstacles, Solid, solids_of
from core.solids.self_collision import find_self_collision
from plugins.vlms.offline.hand import hand_of
from plugins.vlms.offline.layout import CONTACT_M, Layout
from plugins.vlms.offline.making import Made

_LOOK_STEP_M = 0.04  # between two looks
_MISS_M = 0.005  # a pose that is missed by less is reached
_MISS_RAD = 0.03
_PIECE = 8  # places, after which it is asked whether the arm reached them


class Faults(NamedTuple):
    """What is wrong with a design, the worst first, so that the lesser of two is the better design.

    Attributes:
        refused: whether it breaks a rule.
        unreached: the share of its way that is left where the arm misses a pose; 0: it misses none.
        hits: how often it is in something that it must not touch.
    """

    refused: bool = False
    unreached: float = 0.0
    hits: int = 0


class Places(NamedTuple):
    """Places of the tool mount along its way.

    Attributes:
        positions: (K, 3).
        turns: (K, 3, 3).
        numbers: (K,) that of the waypoint to which each is on the way.
    """

    positions: Array
    turns: Array
    numbers: npt.NDArray[np.int64]


def find_faults(
    made: Made,
    layout: Layout,
    most_hits: float = np.inf,
    *,
    keeps_rules: bool = False,
) -> Faults:
    """Find the faults of a design, the cheapest first; what comes after a pose that is missed is not looked for.

    Args:
        made: a tool and its plan.
        layout: where they are tried.
        most_hits: so many are enough.
        keeps_rules: whether it is known that the tool keeps the rules.
    """
    places = find_places(made, layout)
    hits = count_hits(made, layout, places, most_hits)
    if hits >= most_hits:
        return Faults(hits=hits)

    joints, unreached = _follow(places, layout)
    if unreached:
        return Faults(unreached=unreached, hits=hits)
    if not keeps_rules and not obeys(made.tool, layout):
        return Faults(refused=True, hits=hits)

    fingers = np.full(len(joints), layout.robot.opening_m)
    motion = JointTrajectory(np.arange(len(joints), dtype=float), joints, fingers)
    collision = find_self_collision(layout.robot, made.tool, motion)
    return Faults(refused=collision is not None, hits=hits)


def _follow(places: Places, layout: Layout) -> tuple[Array, float]:
    """Find the arm's joints (K, J) at places, as far as it reaches them, and the share of them that is left then.

    It goes on piece by piece, and ends where it misses one, since what is out of reach takes longest.
    """
    arm = arm_of(layout.robot)
    joints = arm.home_for(layout.home)[None]
    count = len(places.positions)

    for first in range(0, count, _PIECE):
        piece = slice(first, first + _PIECE)
        found, errors = arm.follow(
            places.positions[piece], places.turns[piece], joints[-1], arm.jump_rad
        )
        joints = np.vstack([joints, found])
        if (errors > (_MISS_M, _MISS_RAD)).any():
            return joints, 1 - first / count

    return joints, 0.0


def obeys(tool: Tool | None, layout: Layout) -> bool:
    """Report whether a tool keeps the rules for tools, and those for the start; the bare hand does."""
    if tool is None or not tool.components:
        return True

    material = layout.material
    try:
        check_tool(material.made(tool), layout.robot, material)
        layout.spawn.check_start(tool)
    except DesignError:
        return False
    return True


def place_solids(tool: Tool, layout: Layout) -> list[Solid]:
    """Place the solids of a tool, and of the hand, in the frame of the tool mount, with the fingers open."""
    mounts = open_mounts(layout.robot, tool.gripper)
    solids: list[Solid] = []
    if tool.gripper:
        solids += hand_of(layout.robot).solids

    placed = tool.placed()
    for component in tool.components:
        mount, pose = placed[component.name]
        solids += solids_of(component.name, component.shape, mounts[mount] @ pose)

    return solids


def count_hits(made: Made, layout: Layout, places: Places, most: float = np.inf) -> int:
    """Count how often a tool is in something that it must not touch, at places on its way.

    Args:
        made: a tool and its plan.
        layout: where they are tried.
        places: on the way.
        most: so many are enough.
    """
    solids = place_solids(made.tool, layout)
    obstacles = layout.obstacles
    near = _find_near(solids, places, obstacles)

    # What is moved may be touched on the way of steps that say so.
    moved = {*chain.from_iterable(job.moved for job in made.option.jobs)}
    is_moved = np.array([solid.name in moved for solid in obstacles.solids])
    touches = np.array([waypoint.step.touch for waypoint in made.waypoints])
    touches = touches[places.numbers]
    near &= ~(touches[:, None, None] & is_moved)

    hits = 0
    for place, part, other in np.argwhere(near):
        frame = coal.Transform3s(places.turns[place], places.positions[place])
        solid = solids[part]
        hits += _overlap(
            solid.geometry, frame * solid.transform, obstacles.solids[other]
        )
        if hits >= most:
            break

    return hits


def _find_near(
    solids: Sequence[Solid], places: Places, obstacles: Obstacles
) -> npt.NDArray[np.bool_]:
    """Find which solids of a tool are near which obstacles at which places, (K, S, O), by boxes along the world's axes.

    Args:
        solids: S of them, in the frame of the tool mount.
        places: K of them.
        obstacles: O of them.
    """
    boxes = [solid.bounds() for solid in solids]
    middles = np.array([middle for middle, _ in boxes]).reshape(-1, 3)
    halves = np.array([half for _, half in boxes]).reshape(-1, 3)

    turned = np.einsum("kij,sj->ksi", places.turns, middles)
    centers = places.positions[:, None] + turned
    around = np.einsum("kij,sj->ksi", np.abs(places.turns), halves) - CONTACT_M

    gaps = np.abs(centers[:, :, None] - obstacles.centers)
    is_near = gaps <= around[:, :, None] + obstacles.halves
    return np.asarray(is_near.all(axis=-1))


def _overlap(geometry: Any, transform: Any, other: Solid) -> bool:
    """Report whether a geometry of Coal is in a solid by more than a contact."""
    request = coal.DistanceRequest()
    result = coal.DistanceResult()
    gap = coal.distance(
        geometry, transform, other.geometry, other.transform, request, result
    )
    return bool(gap < -CONTACT_M)


def find_places(made: Made, layout: Layout) -> Places:
    """Find places of the tool mount on its way, at both ends of each straight piece and between them."""
    home = layout.home
    way = np.vstack([home.position, made.positions])
    turns = Rotation.concatenate([home.rotation, made.rotations])
    steps = np.diff(way, axis=0)
    counts = np.ceil(step_lengths(way) / _LOOK_STEP_M).astype(int) + 1
    numbers = np.repeat(np.arange(len(steps)), counts)
    shares = np.concatenate([np.linspace(0.0, 1.0, count) for count in counts])

    positions = way[numbers] + shares[:, None] * steps[numbers]
    turned = Slerp(np.arange(len(way)), turns)(numbers + shares)
    return Places(positions, turned.as_matrix(), numbers)

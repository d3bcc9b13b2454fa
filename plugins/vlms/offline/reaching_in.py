"""Move a body as its joint lets it, with a rod that pushes or a hook that pulls; rays find a way in for them.

A rod presses what is to be broken, too: from above, or from a side of the world. What is free and enclosed is moved
straight to its goal.
The rod or the hook meets the body where it goes the farthest along its first way, or in its middle on a slider, and
then moves as the body moves: along a line, or about the hinge. What is to come back then has a second toe before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from core.geometry import Array, Pose
from core.values.joints import PlacedJoint, Placement
from plugins.vlms.offline.boxes import LEVEL, UP
from plugins.vlms.offline.chance import Range
from plugins.vlms.offline.heads import (
    Head,
    Motion,
    add_second_toe,
    make_hook,
    make_piece,
)
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.raycast import (
    HookPoint,
    PushPoint,
    find_hook_points,
    find_push_points,
    find_thickness,
    frame_along,
)
from plugins.vlms.offline.subgoals import Subgoal

# Of the way, past the goal: what springs or sticks ends short of it.
_BEYOND = Range(0.0, 0.4)
ROD = "rod"
"""The kind of a head that is one."""

_SHARE = Range(0.9, 1.15)  # of the way of what is free
_BESIDE_M = 0.07  # of a handle, from the middle of what hangs from it
_LEVEL_M = 0.015  # of a bow, from the middle of what hangs from it without a tilt
_OVER_M = Range(0.02, 0.05)  # what is on the way: what hangs sways
_HIGHER_M = Range(0.0, 0.04)  # than a body is to be raised: it hangs lower at first
_LONGER_M = Range(0.04, 0.07)  # than the way in, for the shaft to stay outside
_INTO_M = 0.006  # its end, that the shaft meets the rod at
_TOUCH_M = Range(0.001, 0.004)  # before the body, where the rod begins to push
_OUT_M = 0.03  # it comes from, before the way in, and draws back at the end
_FROM_NEAR = 0.4  # how often it comes there from a little above: what is near may be high, and not be in its way
_RISE_M = Range(0.03, 0.1)
_STEP_M = 0.045  # between waypoints, of a slider
_STEP_RAD = 0.15  # and of a hinge
_HOOKS = 0.4  # how often a body is pulled that can be pushed, too
_PRESS_M = Range(0.01, 0.03)  # into what is to be broken, which does not give way,
_SHOVE_M = Range(0.03, 0.2)  # and along what a bond holds
_SIDES = ((1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (-1.0, 0.0))
_FROM_ABOVE = 0.6  # how often a thing is pressed from there, rather than from a side
_PRESSES_BOUND = 0.5  # how often what a bond holds is pressed: other heads tear at it
# How often a hook turns with a hinge, rather than only follow its edge.
_TURNS_ALONG = 0.5
_GAP_M = 0.003  # between a hook's arm and the edge that it passes
_PLAY_M = 0.006  # between its two toes and the body, both together


@dataclass(frozen=True, eq=False)
class _Stroke:
    """How a body gets to its goal, and a little beyond.

    Attributes:
        way: which way it goes at first, a unit vector (3,).
        pole: of a hinge, a point of its axis and its direction, (2, 3).
        displacements: of the body in the world, one after another.
        stays: whether the tool is to stay, as a spring would bring the body back.
        returns: whether the body turns back on its way.
        through: how far a rod follows the body into what is around it, metres.
        hangs: whether the body hangs from a hook, which leaves as it came in once the body stands.
    """

    way: Array
    pole: Array | None
    displacements: Sequence[Pose]
    stays: bool = False
    returns: bool = False
    through: float = 0.0
    hangs: bool = False


def _find_motion(
    subgoal: Subgoal,
    joint: str,
    rng: Generator,
) -> _Stroke | None:
    """Find the motion to the goal of a subgoal with a joint; None: of a ball joint, or one that is there.

    Args:
        subgoal: with one body, which has the joint.
        joint: its name.
        rng: random numbers, of how far it goes beyond the goal.
    """
    placed = subgoal.model.scene.placed_joints[joint]
    spec = placed.joint
    body = subgoal.solids[0].body
    assert subgoal.goal is not None
    missing = float(subgoal.goal.to) - spec.start
    if spec.kind == "ball" or not missing:
        return None

    way = body.pose.rotation.apply(spec.axis) * np.sign(missing)
    pole = None

    if spec.kind == "hinge":
        pole = np.stack([body.pose.apply(spec.origin), way])
        speeds = np.cross(way, subgoal.points - pole[0])
        way = speeds[int(np.linalg.norm(speeds, axis=1).argmax())]

    beyond = missing * _BEYOND.draw(rng)
    end = np.clip(subgoal.goal.to + beyond, spec.lower, spec.upper)
    displacements = _find_displacements(subgoal, placed, spec.start, end)

    later = () if spec.springs_back else subgoal.goal.later
    lets_back = subgoal.is_released or subgoal.goal.ever or bool(subgoal.goal.later)
    legs = np.diff([spec.start, subgoal.goal.to, *later])
    for position in later:
        displacements += _find_displacements(subgoal, placed, end, position)
        end = position

    return _Stroke(
        way / np.linalg.norm(way),
        pole,
        displacements,
        stays=spec.springs_back and not lets_back,
        returns=bool((legs * missing < 0).any()),
    )


def _find_displacements(
    subgoal: Subgoal,
    placed: PlacedJoint,
    begin: float,
    end: float,
) -> list[Pose]:
    """Compute the displacements of a joint's body on the way from a position of the joint to another one.

    Args:
        subgoal: with one body, which has the joint.
        placed: the joint in its layout.
        begin: the position that it has, metres or radians.
        end: the position that it gets.
    """
    joint = placed.joint
    parent = Pose()

    if joint.parent:
        parent = subgoal.model.scene[joint.parent].pose

    resting = Placement.at_rest(parent)
    step = _STEP_RAD if joint.kind == "hinge" else _STEP_M
    count = max(2, int(np.ceil(abs(end - begin) / step)))

    back = subgoal.solids[0].body.pose.inverse()

    displacements = []
    for position in np.linspace(begin, end, count + 1)[1:]:
        place = placed.carry(np.asarray(position), np.zeros(()), resting)
        displacements.append(Pose(place.position, place.quaternion) @ back)

    return displacements


def make_joint_mover(
    subgoal: Subgoal,
    joint: str,
    rng: Generator,
) -> Head | None:
    """Make a rod or a hook that moves a body as its joint lets it; None: neither gets to it.

    Args:
        subgoal: with one body, which has the joint.
        joint: its name.
        rng: random numbers.
    """
    motion = _find_motion(subgoal, joint, rng)
    if motion is None:
        return None

    return _make_mover(subgoal, motion, rng)


def make_straight_mover(subgoal: Subgoal, rng: Generator) -> Head | None:
    """Make a rod or a hook that moves a body straight to its goal on the level; None: neither gets to it.

    Args:
        subgoal: with one body, which is free.
        rng: random numbers.
    """
    if subgoal.length < _STEP_M:
        return None

    way = subgoal.shift * LEVEL / subgoal.length
    length = subgoal.length * _SHARE.draw(rng)
    through = length if subgoal.slides_out else 0.0
    motion = _Stroke(way, None, _go_straight(way, length), through=through)
    return _make_mover(subgoal, motion, rng)


def find_handle_points(subgoal: Subgoal) -> list[HookPoint]:
    """Find where a hook lifts a body by what stands out of it, such as a handle; empty: it has nothing of the kind.

    Args:
        subgoal: with one body.
    """
    points = find_hook_points(subgoal, UP)
    return [point for point in points if _hangs_well(point, subgoal)]


def make_handle_lifter(subgoal: Subgoal, rng: Generator) -> Head:
    """Make a hook that lifts a body by a handle, which it has.

    Args:
        subgoal: with one body, which is to be held in the air above where it is.
        rng: random numbers.
    """
    points = find_handle_points(subgoal)
    height = subgoal.shift[2] + _HIGHER_M.draw(rng)
    motion = _Stroke(UP, None, _go_straight(UP, height), stays=True)
    return _make_hook(subgoal, motion, points[rng.integers(len(points))], rng)


def find_bow_points(subgoal: Subgoal) -> list[HookPoint]:
    """Find where a hook gets through a bow above a body's middle, so that the body hangs from it; empty: nowhere.

    Args:
        subgoal: with one body.
    """
    points = find_hook_points(subgoal, UP)
    return [point for point in points if _hangs_level(point, subgoal)]


def _hangs_level(point: HookPoint, subgoal: Subgoal) -> bool:
    """Report whether the toe of a hook gets from a point to below a bow that is over the bodies' middle."""
    outward = frame_along(UP).apply(point.outward)
    beside = (point.point - subgoal.center) * LEVEL
    off = beside @ outward
    across = np.linalg.norm(beside - off * outward)
    return bool(across < _LEVEL_M and -_LEVEL_M < off < point.toe)


def make_bow_carrier(subgoal: Subgoal, rng: Generator) -> Head:
    """Make a hook that carries a body by a bow, which it has, and sets it down at its goal.

    Args:
        subgoal: with one body, whose goal is a place.
        rng: random numbers.
    """
    points = find_bow_points(subgoal)
    high = max(subgoal.shift[2], subgoal.height_on_way - subgoal.lower[2])
    high += _OVER_M.draw(rng)
    down = subgoal.shift[2] - high

    lifted = _go_straight(UP, high)
    over = _go_straight(subgoal.shift * LEVEL / subgoal.length, subgoal.length)
    ways = [*lifted, *(lifted[-1] @ step for step in over)]
    end = ways[-1]
    if not subgoal.is_held:
        ways += [end @ step for step in _go_straight(-UP, -down)]

    motion = _Stroke(UP, None, ways, stays=subgoal.is_held, hangs=True)
    return _make_hook(subgoal, motion, points[rng.integers(len(points))], rng)


def _hangs_well(point: HookPoint, subgoal: Subgoal) -> bool:
    """Report whether bodies that hang from a point are little beside it, so that they tip little."""
    beside = (point.point - subgoal.center) * LEVEL
    return bool(np.linalg.norm(beside) < _BESIDE_M)


def _go_straight(way: Array, length: float) -> list[Pose]:
    """Return displacements along a way (3,), one after another, up to a length in metres."""
    count = max(1, int(np.ceil(length / _STEP_M)))
    return [Pose(length * (i + 1) / count * way) for i in range(count)]


def _make_mover(subgoal: Subgoal, motion: _Stroke, rng: Generator) -> Head | None:
    """Make a rod or a hook for a motion; None: neither gets to the body.

    Args:
        subgoal: with the body.
        motion: of the body.
        rng: random numbers.
    """
    pushes = find_push_points(subgoal, motion.way, motion.pole)
    pulls = find_hook_points(subgoal, motion.way, motion.pole)
    if pulls and (motion.returns or not pushes or rng.random() < _HOOKS):
        return _make_hook(subgoal, motion, pulls[rng.integers(len(pulls))], rng)
    if pushes:
        return _make_rod(subgoal, motion, pushes[rng.integers(len(pushes))], rng)

    return None


def make_presser(subgoal: Subgoal, rng: Generator) -> Head | None:
    """Make a rod that presses a body until it breaks, or a bond that holds it; None: it gets nowhere, or not this time.

    Args:
        subgoal: with one body, free or fixed.
        rng: random numbers.
    """
    body = subgoal.solids[0].body
    bonds = subgoal.model.scene.bonds
    holds = any(body.name in (bond.body, bond.parent) for bond in bonds)
    if holds and rng.random() >= _PRESSES_BOUND:
        return None

    depth = (_SHOVE_M if holds else _PRESS_M).draw(rng)

    ways = [np.array([*side, 0.0]) for side in _SIDES]
    ways.insert(0 if rng.random() < _FROM_ABOVE else len(ways), -UP)
    if holds:
        ways = [ways[number] for number in rng.permutation(len(ways))]

    for way in ways:
        points = find_push_points(subgoal, way, free=0.0)
        if points:
            motion = _Stroke(way, None, _go_straight(way, depth))
            return _make_rod(subgoal, motion, points[rng.integers(len(points))], rng)

    return None


def _approach(
    path: HeadPath, subgoal: Subgoal, turn: Pose, outside: Array, rng: Generator
) -> None:
    """Come down to where a way in begins: from above everything near, or from a little above it.

    Args:
        path: that waypoints are added to.
        subgoal: with the body.
        turn: of the head.
        outside: the place, (3,).
        rng: random numbers.
    """
    if rng.random() < _FROM_NEAR:
        path.go(turn, outside + _RISE_M.draw(rng) * UP, outside)
    else:
        path.descend(subgoal, turn, outside)


def _make_rod(
    subgoal: Subgoal, motion: _Stroke, chosen: PushPoint, rng: Generator
) -> Head:
    """Make a rod that pushes a body at a point.

    Args:
        subgoal: with the body.
        motion: of the body.
        chosen: the point.
        rng: random numbers.
    """
    way = motion.way
    farthest = max(
        float((shift.apply(chosen.point) - chosen.point) @ way)
        for shift in motion.displacements
    )
    length = max(chosen.length + motion.through, chosen.under + farthest)
    length += _LONGER_M.draw(rng)

    def push(path: HeadPath, rng: Generator) -> str:
        """Thrust the rod against the body, follow the body's motion, and draw back unless it is to stay."""
        turn = frame_along(way)
        tip = chosen.point - way * _TOUCH_M.draw(rng)
        outside = chosen.point - way * (chosen.length + _OUT_M)
        _approach(path, subgoal, turn, outside, rng)
        path.go(turn, tip)
        end = path.follow(motion.displacements)
        if not motion.stays:
            path.go(end, end.position - way * _OUT_M, touch=True)

        return f"thrusts a rod of {length:.2f} m against the body, along the way that it is free to go"

    return _make_rod_head(length, 2 * chosen.half, push)


def join_rods(heads: Sequence[Head], height: float) -> Head | None:
    """Join rods for several subgoals: as long as the longest and as thin as the thinnest; None: some is no rod.

    Args:
        heads: one for each subgoal, in the order in which they are reached.
        height: above everything near, where the rod turns around, metres.
    """
    if any(head.kind != ROD for head in heads):
        return None

    length = max(head.pieces[0].size[0] for head in heads)
    thick = min(head.width for head in heads)
    motions = [head.motion for head in heads if head.motion is not None]

    def do_all(path: HeadPath, rng: Generator) -> str:
        """Do what each rod is for, one after another; come out of each way in."""
        texts = [motions[0](path, rng)]
        outside = path.poses[1]
        for motion in motions[1:]:
            path.add(outside, touch=True)
            path.end_stage()
            begin = len(path.poses)
            texts.append(motion(path, rng))
            outside = path.poses[begin + 1]
            path.turn_above(begin, height)

        return "; then ".join(texts)

    return _make_rod_head(length, thick, do_all)


def _make_rod_head(length: float, thick: float, motion: Motion) -> Head:
    """Make a rod whose tip is at the origin.

    Args:
        length: of the rod, metres.
        thick: of the rod, metres.
        motion: of the head.
    """
    rod = make_piece(ROD, -length / 2, 0.0, 0.0, (length, thick, thick))
    attachment = np.array([_INTO_M - length, 0.0, 0.0])
    return Head(ROD, "guided", (rod,), attachment, 0.0, thick, motion=motion)


def _make_hook(
    subgoal: Subgoal, motion: _Stroke, chosen: HookPoint, rng: Generator
) -> Head:
    """Make a hook that pulls a body by the edge of a face.

    Args:
        subgoal: with the body.
        motion: of the body.
        chosen: a point of the edge.
        rng: random numbers.
    """
    way = motion.way
    length = chosen.length + _LONGER_M.draw(rng)
    thick = 2 * chosen.half
    if motion.returns:
        inside = chosen.point - _GAP_M * frame_along(way).apply(chosen.outward)
        along = find_thickness(subgoal.boxes, inside, way)
        length = max(length, along + _PLAY_M + 2 * thick)

    head = make_hook(length, chosen.toe, thick, thick, _GAP_M, chosen.outward)
    if motion.returns:
        head = add_second_toe(head, along + _PLAY_M + thick)

    attachment = (_GAP_M + chosen.half) * chosen.outward
    attachment[0] = length - _INTO_M
    turns = motion.pole is None or rng.random() < _TURNS_ALONG

    def pull(path: HeadPath, rng: Generator) -> str:
        """Bring the hook in beside the edge, get behind it, follow the body, and let go unless it is to stay."""
        turn = frame_along(way)
        beside = turn.apply(head.aside)
        behind = chosen.point - way * _TOUCH_M.draw(rng)
        outside = chosen.point + beside + way * (chosen.length + _OUT_M)
        _approach(path, subgoal, turn, outside, rng)
        path.go(turn, behind + beside, behind)

        if turns:
            path.follow(motion.displacements)
        else:
            edges = [shift.apply(behind) for shift in motion.displacements]
            path.go(turn, *edges, touch=True)

        if motion.hangs and not motion.stays:
            out = path.end + beside
            path.go(turn, out, out + (subgoal.height + _OUT_M) * UP, touch=True)
        elif not (motion.stays or motion.returns):
            end = path.poses[-1]
            back = end.rotation.apply([-_OUT_M, 0.0, 0.0])
            path.go(end, end.position + back, touch=True)

        return f"gets a hook of {length:.2f} m behind an edge of the body, and pulls it the way that it is free to go"

    return replace(
        head, primitive="guided", attachment=attachment, aside=np.zeros(3), motion=pull
    )

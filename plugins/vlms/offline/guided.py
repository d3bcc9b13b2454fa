"""Heads with motion primitives of their own, which follow from what holds a body, or from how it is to be turned.

Rays through the scene find where a rod gets, to push a body along its joint, and where tines get under a body, to lift
it off what it stands in, or to turn it over its opposite edge. A fork takes a loose container by its handles, and turns
it over.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from core.values.joints import Placement
from plugins.vlms.offline.boxes import axes_of
from plugins.vlms.offline.heads import SIDES, Head, Piece, box
from plugins.vlms.offline.plans import Path
from plugins.vlms.offline.raycast import Under, frame_of, pushed, under
from plugins.vlms.offline.scene_analysis import UP, Subgoal, turn_between

_TURNED = np.radians(20.0)  # a goal about an orientation that is farther off than this
_STEP_M = 0.045  # between waypoints, as for a hinge
_STEP_RAD = 0.15
_QUARTERS: list[float] = (np.arange(4) * np.pi / 2).tolist()
_BACK_M = 0.018  # a fork's plate and crossbar, from the flange ahead
_LIP_M = 0.004  # thickness of a fork's channels


Primitive = Callable[[Path, Generator], str]
Motion = Sequence[Pose]  # of a body: displacements in the world, one after another


def suits(subgoal: Subgoal) -> bool:
    """Report whether the subgoal's only body hangs from a joint, is to be turned, or stands in or around another."""
    goal = subgoal.goal
    if goal is None or len(subgoal.solids) > 1:
        return False
    lower, upper = subgoal.others.bounds
    held = (lower < subgoal.upper - 0.003) & (upper > subgoal.lower + 0.003)
    return (
        goal.joint is not None
        or _turn(subgoal) is not None
        or bool(held.all(axis=1).any())
    )


def guided(subgoal: Subgoal, rng: Generator) -> Head | None:
    """Make a head for a subgoal that `suits`; None: there is no way in."""
    assert subgoal.goal is not None
    if subgoal.goal.joint is not None:
        return mover(subgoal, rng)
    turn = _turn(subgoal)
    return carrier(subgoal, rng) if turn is None else tipper(subgoal, turn, rng)


def _turn(subgoal: Subgoal) -> tuple[Array, float] | None:
    """Compute the axis (3,) about which the bodies are to be turned, level or nearly so, and the angle."""
    if subgoal.goal is None or subgoal.goal.axis is None:
        return None
    axis, angle = turn_between(subgoal.goal, subgoal.solids[0].body)
    if (
        angle < max(_TURNED, np.radians(subgoal.goal.tolerance_deg))
        or abs(axis[2]) > 0.5 * np.linalg.norm(axis) + 1e-6
    ):
        return None
    return axis, angle


def _choose_under(
    subgoal: Subgoal, headings: Sequence[float], width: float, rng: Generator
) -> Under | None:
    """Choose at random among the places that are worth most; None: there is none."""
    places = [
        place
        for heading in headings
        if (place := under(subgoal, heading, width)) is not None
    ]
    good = [
        place
        for place in places
        if place.worth > max(other.worth for other in places) - 0.03
    ]
    return good[int(rng.integers(len(good)))] if good else None


def _tines(
    kind: str,
    spot: Under,
    width: float,
    thick: float,
    depth: float,
    primitive: Primitive,
) -> Head:
    """Two tines ahead of a wall, or a wide one; their upper faces are at z = 0."""
    across = 2 * spot.apart + width
    pieces = [box("wall", -0.004, 0.0, 0.015 - thick, (0.008, across, 0.03))]
    for number, side in enumerate(
        (1.0, -1.0) if spot.apart > width / 2 else (0.0,), start=1
    ):
        size = (depth + 0.008, width, thick)
        pieces.append(
            box(
                f"tine_{number}",
                (depth - 0.008) / 2,
                side * spot.apart,
                -thick / 2,
                size,
            )
        )
    return Head(
        kind,
        "guided",
        tuple(pieces),
        np.array([0.0, 0.0, 0.03 - thick]),
        depth,
        across,
        primitive=primitive,
    )


def carrier(subgoal: Subgoal, rng: Generator) -> Head | None:
    """Tines that lift a body out of what it stands in, carry it over, and lower it at the goal."""
    width = 0.009
    high = 0.2 * UP
    if any(
        subgoal.blocked(high, start, step=0.006)
        for start in (np.zeros(3), subgoal.shift + 0.004 * UP)
    ):
        return None
    if (spot := _choose_under(subgoal, _QUARTERS, width, rng)) is None:
        return None
    ahead = axes_of(spot.heading)[0]
    gap = rng.uniform(0.01, 0.02)
    depth = gap + min(spot.depth, float(np.ptp(subgoal.points @ ahead)))

    def primitive(path: Path, rng: Generator) -> str:
        inside = spot.rear - gap * ahead - 0.001 * UP
        path.enter(subgoal, spot.heading, inside - (depth + 0.02) * ahead, inside)
        path.hold()
        lifted = inside + 0.001 * UP
        goal = inside + 0.001 * UP + subgoal.shift
        over = [
            np.array(
                [*place[:2], max(lifted[2], goal[2]) + 0.2 + rng.uniform(0.0, 0.03)]
            )
            for place in (lifted, goal)
        ]
        for place in (lifted, *over, goal, goal - rng.uniform(0.004, 0.012) * UP):
            length = float(np.linalg.norm(place - path.poses[-1].position))
            path.move(place, spot.heading, 0.15 if length > 0.02 else 1.0)
        path.go(
            spot.heading, path.poses[-1].position - (depth + 0.02) * ahead, touch=True
        )
        return "gets tines under the body, lifts it off, carries it over, lowers it and leaves"

    return _tines("tines", spot, width, min(0.008, spot.room / 2), depth, primitive)


def tipper(subgoal: Subgoal, turn: tuple[Array, float], rng: Generator) -> Head | None:
    """A lip that raises a body by one side, and turns it about its opposite edge."""
    axis, angle = turn
    headings = _QUARTERS
    width = 0.016
    if np.linalg.norm(axis) > 0.2:
        x, y, _ = np.cross(axis, UP)
        headings = [float(np.arctan2(y, x))]
    if (spot := _choose_under(subgoal, headings, width, rng)) is None:
        return None
    ahead = axes_of(spot.heading)[0]
    thick = min(0.008, 0.6 * spot.room)
    grip = min(spot.depth * rng.uniform(0.5, 0.9), 0.04)
    gap = rng.uniform(0.006, 0.015)
    pivot = spot.rear + (subgoal.extent(spot.heading).front - spot.rear @ ahead) * ahead
    pivot[2] = subgoal.lower[2]
    radius = float((pivot - spot.rear) @ ahead) - grip
    most = angle + rng.uniform(0.0, 0.15) if angle < 2.0 else rng.uniform(1.7, 2.3)
    depth = grip + gap  # from the face to the tip

    def primitive(path: Path, rng: Generator) -> str:
        tip = spot.rear + grip * ahead - 0.001 * UP
        path.enter(
            subgoal,
            spot.heading,
            tip - depth * ahead - (depth + 0.02) * ahead,
            tip - depth * ahead,
        )
        path.hold()
        rise = float(tip[2] - pivot[2])
        for turned in np.linspace(0.0, most, int(np.ceil(most / _STEP_RAD)) + 1)[1:]:
            arm = Rotation.from_rotvec(np.cross(UP, ahead) * turned).apply(
                -radius * ahead + rise * UP
            )
            path.go(spot.heading, pivot + arm - depth * ahead, touch=True)
        path.go(
            spot.heading, path.poses[-1].position - 0.06 * ahead + 0.02 * UP, touch=True
        )
        return f"raises one side by a lip, and turns the body about its other edge by {np.degrees(most):.0f} degrees"

    return _tines("lip", spot, width, thick, depth, primitive)


def _joint_way(
    subgoal: Subgoal, rng: Generator
) -> tuple[Array, Array | None, Motion] | None:
    """Compute the way (3,) that a joint's body goes at first, the joint's pole if it is a hinge, and all the motion.

    The pole (2, 3) is a point of the axis, and its direction. The motion goes a little beyond the goal.
    """
    assert subgoal.goal is not None
    placed = subgoal.analysis.scene.placed_joints[subgoal.goal.joint or ""]
    body = subgoal.solids[0].body
    joint = placed.joint
    to = float(subgoal.goal.to or 0.0)
    if joint.kind == "ball" or to == joint.start:
        return None
    way = body.pose.rotation.apply(joint.axis) * np.sign(to - joint.start)
    pole = None
    if joint.kind == "hinge":
        pole = np.stack([body.pose.apply(joint.origin), way])
        turned = np.cross(way, subgoal.points - pole[0])
        way = turned[int(np.linalg.norm(turned, axis=1).argmax())]
    to = float(
        np.clip(
            to + (to - joint.start) * rng.uniform(0.0, 0.4), joint.lower, joint.upper
        )
    )
    parent = Placement.at_rest(
        subgoal.analysis.scene[joint.parent].pose if joint.parent else Pose()
    )
    count = max(
        2,
        int(
            np.ceil(
                abs(to - joint.start)
                / (_STEP_RAD if joint.kind == "hinge" else _STEP_M)
            )
        ),
    )
    places = (
        placed.carry(np.asarray(v), np.zeros(()), parent)
        for v in np.linspace(joint.start, to, count + 1)[1:]
    )
    motion = [
        Pose(there.position, there.quaternion) @ body.pose.inverse() for there in places
    ]
    return way / np.linalg.norm(way), pole, motion


def mover(subgoal: Subgoal, rng: Generator) -> Head | None:
    """A rod that pushes, or a hook that pulls, a body along the motion that its joint leaves it."""
    if (known := _joint_way(subgoal, rng)) is None:
        return None
    way, pole, motion = known
    contacts = pushed(subgoal, way, pole)
    if not contacts:
        return None
    contact = contacts[int(rng.integers(len(contacts)))]
    length = contact.length + rng.uniform(0.04, 0.07)
    thick = 2 * contact.half

    def primitive(path: Path, rng: Generator) -> str:
        tip = contact.point - way * rng.uniform(0.001, 0.004)
        path.enter(
            subgoal, frame_of(way), contact.point - way * (contact.length + 0.03), tip
        )
        end = path.follow(motion)
        path.go(end, end.position - way * 0.03, touch=True)
        return f"thrusts a rod of {length:.2f} m against the body, along the way that it is free to go"

    pieces = (box("rod", -length / 2, 0.0, 0.0, (length, thick, thick)),)
    return Head(
        "rod",
        "guided",
        pieces,
        np.array([0.006 - length, 0.0, 0.0]),
        0.0,
        thick,
        primitive=primitive,
    )


def handles(subgoal: Subgoal) -> tuple[Subgoal, float, float] | None:
    """The bodies' loose container, if parts stand out of it on both sides: the subgoal of moving it as they are, the
    heading that is easiest to reach from the arm's side, and the container's half width without them. None: no such.
    """
    if subgoal.holder is None:
        return None
    pan = Subgoal((subgoal.holder,), subgoal.shift, subgoal.analysis)
    away = subgoal.space.direction(subgoal.holder.position)
    for heading in sorted(_QUARTERS, key=lambda turn: -np.cos(turn - away))[:2]:
        out, halves = pan.overhang(heading)
        right, left = pan.boxes.extents(axes_of(heading)[1], pan.center)
        if (out & (left > 0)).any() and (out & (right < 0)).any() and not out.all():
            return pan, heading, float(halves[~out].max())
    return None


def pourer(
    subgoal: Subgoal, grips: tuple[Subgoal, float, float], rng: Generator, stout: float
) -> Head:
    """Two channels, open toward each other, that slide over the handles of the bodies' container.

    It is lifted, carried to the goal and turned over there by the arm's last joint: the flange points ahead, and the
    head's frame is the flange's: x along the axis of that joint. The channels are ``drop`` below it, and ``stout``
    times as thick as usual.
    """
    pan, heading, base = grips
    ahead, _ = axes_of(heading)
    out, halves = pan.overhang(heading)
    lower, upper = pan.boxes.bounds
    rear = float(((pan.points - pan.center) @ ahead).min())
    reach = float(pan.boxes.extents(ahead, pan.center)[1][out].max())
    low = float(lower[out, 2].min())
    high = float(upper[out, 2].max())
    outer = float(halves[out].max())
    lip = stout * _LIP_M
    drop = rng.uniform(0.07, 0.12)
    room = rng.uniform(0.002, 0.005)
    gap = rng.uniform(0.003, 0.012)  # between the crossbar and the container
    inner = base + 0.3 * (outer - base)
    side = outer + room
    length = reach - rear + gap + rng.uniform(-0.03, 0.015)
    tall = high - low + 2 * room

    pieces = _channels(length, drop, (inner, side), tall, lip)

    def primitive(path: Path, rng: Generator) -> str:
        grasp = pan.center + (rear - gap - _BACK_M) * ahead
        grasp[2] = (low + high) / 2 + drop
        before = grasp - (length + rng.uniform(0.01, 0.03)) * ahead
        path.go(heading, before + rng.uniform(0.06, 0.15) * UP, before)
        path.move(grasp, heading, rng.uniform(0.1, 0.3))

        # High enough for the container to pass over everything near, upright and on its side.
        height = subgoal.clear_z + max(
            grasp[2] - pan.lower[2], float(np.ptp(pan.points[:, :2], axis=0).min()) / 2
        )
        height += rng.uniform(0.01, 0.06)
        path.move(np.array([*grasp[:2], height]), heading, rng.uniform(0.1, 0.3))
        path.hold()

        place = (
            np.mean([solid.position for solid in subgoal.solids], axis=0)
            + subgoal.shift
        )
        there_heading = subgoal.space.direction(place) + rng.uniform(-0.5, 0.8)
        sign = float(rng.choice([-1.0, 1.0]))
        turn = rng.uniform(2.2, 3.0)
        onward, aside = axes_of(there_heading)
        there = place - (gap + _BACK_M - rear) * onward - sign * 0.5 * drop * aside
        there[2] = height
        path.move(there, there_heading, rng.uniform(0.15, 0.4))

        for share in np.linspace(0.0, 1.0, int(rng.integers(3, 7)) + 1)[1:]:
            path.add(
                Pose.xyz_rpy(there, (sign * share * turn, 0.0, there_heading)),
                touch=True,
            )
        path.go(path.poses[-1], there + 0.02 * UP, there, there + 0.02 * UP, touch=True)
        carried = f"slides over the handles, lifts, carries by {subgoal.length:.2f} m"
        return f"{carried} and turns over by {np.degrees(turn):.0f} degrees"

    pose = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0))
    return Head(
        "fork",
        "pour",
        tuple(pieces),
        np.zeros(3),
        length,
        2 * (side + lip),
        primitive=primitive,
        pose=pose,
    )


def _channels(
    length: float, drop: float, sides: tuple[float, float], tall: float, lip: float
) -> list[Piece]:
    """A plate below the flange, a crossbar, and two channels that are open toward each other.

    The channels are ``tall`` inside, and reach across from the first of ``sides`` to the second on both sides.
    """
    inner, outer = sides
    along = _BACK_M - 0.002 + length / 2
    pieces = [
        box("plate", 0.005, 0.0, -drop / 2, (0.01, 0.06, drop + 0.07)),
        box("crossbar", _BACK_M - 0.005, 0.0, -drop, (0.01, 2 * (outer + lip), 0.03)),
    ]
    for name, sign in SIDES:
        web = (length + 0.002, lip, tall + 2 * lip)
        pieces.append(
            box(f"{name}_web", along, sign * (outer + lip / 2), -drop, web, 1)
        )
        for edge, up in (("lower", -1.0), ("upper", 1.0)):
            z = -drop + up * (tall + lip) / 2
            size = (length + 0.002, outer - inner + 0.002, lip)
            pieces.append(
                box(f"{name}_{edge}", along, sign * (inner + outer) / 2, z, size, 1)
            )
    return pieces

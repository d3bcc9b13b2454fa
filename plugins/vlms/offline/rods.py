"""Rods that push a body along its joint, and hooks that pull it out of where it is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.geometry import Array, Pose
from core.values.joints import Placement
from plugins.vlms.offline.heads import Head, Piece, box
from plugins.vlms.offline.openings import Contact, frame_of, pulled, pushed
from plugins.vlms.offline.plans import Path
from plugins.vlms.offline.scene_analysis import UP, Errand

_STEP_M, _STEP_RAD = 0.045, 0.15  # between waypoints

Motion = Sequence[Pose]  # of a body: displacements in the world, one after another


def _rod(contact: Contact, length: float, toe: Array | None) -> list[Piece]:
    """A rod along -x, or along x with a toe (3,) across its end."""
    thick = 2 * contact.half
    if toe is None:
        return [box("rod", -length / 2, 0.0, 0.0, (length, thick, thick))]
    way = toe / np.linalg.norm(toe)
    ends = -way * (contact.off + contact.half), toe
    middle, extent = (ends[0] + ends[1]) / 2, np.abs(ends[1] - ends[0])
    offset, size = -way * contact.off, np.where(extent > 1e-6, extent, thick)
    return [
        box("rod", length / 2 - 0.006, offset[1], offset[2], (length, thick, thick)),
        box("toe", -0.003, middle[1], middle[2], (0.006, float(size[1]), float(size[2]))),
    ]


def _follow(path: Path, motion: Motion) -> Pose:
    """Move the head as the body moves; returns where the head ends."""
    head = path.poses[-1]
    for moved in motion:
        path.add(moved @ head, touch=True)
    return path.poses[-1]


def _joint_way(errand: Errand, rng: np.random.Generator) -> tuple[Array, Array | None, Motion] | None:
    """Compute the way (3,) that a joint's body goes at first, the joint's pole if it is a hinge, and all the motion.

    The pole (2, 3) is a point of the axis, and its direction. The motion goes a little beyond the goal.
    """
    assert errand.goal is not None
    placed, body = errand.analysis.scene.placed_joints[errand.goal.joint or ""], errand.things[0].body
    joint, to = placed.joint, float(errand.goal.to or 0.0)
    if joint.kind == "ball" or to == joint.start:
        return None
    way, pole = body.pose.rotation.apply(joint.axis) * np.sign(to - joint.start), None
    if joint.kind == "hinge":
        pole = np.stack([body.pose.apply(joint.origin), way])
        turned = np.cross(way, errand.points - pole[0])
        way = turned[int(np.linalg.norm(turned, axis=1).argmax())]
    to = float(np.clip(to + (to - joint.start) * rng.uniform(0.0, 0.4), joint.lower, joint.upper))
    parent = Placement.at_rest(errand.analysis.scene[joint.parent].pose if joint.parent else Pose())
    count = max(2, int(np.ceil(abs(to - joint.start) / (_STEP_RAD if joint.kind == "hinge" else _STEP_M))))
    places = (placed.carry(np.asarray(v), np.zeros(()), parent) for v in np.linspace(joint.start, to, count + 1)[1:])
    motion = [Pose(there.position, there.quaternion) @ body.pose.inverse() for there in places]
    return way / np.linalg.norm(way), pole, motion


def mover(errand: Errand, rng: np.random.Generator) -> Head | None:
    """A rod that pushes, or a hook that pulls, a body along the motion that its joint leaves it."""
    if (known := _joint_way(errand, rng)) is None:
        return None
    way, pole, motion = known
    contacts = pushed(errand, way, pole)
    if not contacts or rng.random() < 0.2:
        contacts = pulled(errand, way) or contacts
    if not contacts:
        return None
    contact = contacts[int(rng.integers(len(contacts)))]
    if contact.aside.any():
        return _hooked(errand, contact, way, motion, rng)
    length, turn = contact.length + rng.uniform(0.04, 0.07), frame_of(way)

    def stroke(path: Path, rng: np.random.Generator) -> str:
        tip = contact.point - way * rng.uniform(0.001, 0.004)
        path.enter(errand, turn, contact.point - way * (contact.length + 0.03), tip)
        end = _follow(path, motion)
        path.go(end, end.position - way * 0.03, touch=True)
        return f"thrusts a rod of {length:.2f} m against the body, along the way that it is free to go"

    hold, thick = np.array([0.006 - length, 0.0, 0.0]), 2 * contact.half
    return Head("rod", "guided", tuple(_rod(contact, length, None)), hold, 0.0, thick, stroke=stroke)


def _hooked(
    errand: Errand, contact: Contact, way: Array, motion: Motion, rng: np.random.Generator, then: Array | None = None
) -> Head:
    """A hook that enters beside the body, gets behind it and pulls; ``then`` (3,) is the way that is left."""
    turn = frame_of(way)
    toe = turn.inverse().apply(contact.aside)
    extent = float(np.ptp(errand.points @ way))
    length = max(contact.length, extent) + rng.uniform(0.02, 0.05) + 0.02

    def stroke(path: Path, rng: np.random.Generator) -> str:
        behind = contact.point
        beside = behind - contact.aside * (1 + 0.003 / np.linalg.norm(contact.aside))
        out = way * (max(contact.length, extent) + 0.03)
        path.enter(errand, turn, beside + out, beside, behind)
        end = _follow(path, motion)
        if then is not None:
            slide = rng.uniform(0.0, 0.012) * way
            moved = errand.points + motion[-1].position + slide
            _nudge(path, end, (toe / 2, np.abs(toe) / 2 + contact.half), moved, then, rng)
        return "gets behind the body through the opening, and pulls it along the way that it is free to go"

    offset = -toe / np.linalg.norm(toe) * contact.off
    hold = np.array([length - 0.012, offset[1], offset[2] + contact.half - 0.002])
    return Head("hook", "guided", tuple(_rod(contact, length, toe)), hold, 0.0, 2 * contact.half, stroke=stroke)


def _nudge(
    path: Path, head: Pose, foot: tuple[Array, Array], points: Array, shift: Array, rng: np.random.Generator
) -> None:
    """Lift the head over a body of ``points``, and push it by the foot (middle, half sides) along a shift."""
    length = float(np.hypot(*shift[:2]))
    way = np.array([*shift[:2], 0.0]) / length
    middle, halves = foot
    turn = head.rotation.as_matrix()
    reach = float(np.abs(turn.T @ way) @ halves)
    along = points @ way
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    drop = float(np.abs(turn.T @ UP) @ halves)
    behind = center + way * (float(along.min() - center @ way) - reach - 0.008)
    behind[2] = float(points[:, 2].min()) + drop + 0.004
    behind = behind - turn @ middle
    high = float(points[:, 2].max()) + 2 * drop + 0.03
    back = head.rotation.apply([-0.02, 0.0, 0.0])  # away from the body
    start = head.position + back
    over = [np.array([*place[:2], high]) for place in (start, behind)]
    end = behind + way * (length + 0.008) * rng.normal(1.0, 0.03)
    pushes = np.linspace(behind, end, max(2, int(length / 0.08)) + 1)[1:]
    path.go(head, start, *over, behind, *pushes, end - 0.03 * way, touch=True)


def drawer(errand: Errand, route: Sequence[Array], rng: np.random.Generator) -> Head | None:
    """A hook that draws a body out of an enclosure, and then pushes it to the goal."""
    out = route[-1]
    way = out / np.linalg.norm(out)
    contacts = pulled(errand, way)
    if not contacts:
        return None
    contact = contacts[int(rng.integers(len(contacts)))]
    out = out + way * rng.uniform(0.02, 0.06)
    count = int(np.ceil(np.linalg.norm(out) / _STEP_M))
    motion = [Pose(share * out) for share in np.linspace(0.0, 1.0, count + 1)[1:]]
    left = (errand.shift - out) * np.array([1.0, 1.0, 0.0])
    return _hooked(errand, contact, way, motion, rng, left if np.linalg.norm(left) > 0.01 else None)

"""Heads with strokes of their own, which follow from what holds a body, or from how it is to be turned.

Rays through the scene find where a rod gets, to push a body along its joint, and where tines get under a body, to lift
it off what it stands in, or to turn it over its opposite edge. A fork takes a loose container by its handles, and turns
it over.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar, cast

import numpy as np
from scipy.ndimage import minimum_filter
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from core.values.joints import Placement
from plugins.vlms.offline.boxes import Boxes, axes_of
from plugins.vlms.offline.heads import SIDES, Head, box
from plugins.vlms.offline.plans import Path
from plugins.vlms.offline.scene_analysis import UP, Errand

_TURNED = np.radians(20.0)  # a goal about an orientation that is farther off than this
_STEP_M, _STEP_RAD = 0.045, 0.15  # between waypoints
_QUARTERS: list[float] = (np.arange(4) * np.pi / 2).tolist()
_BACK_M = 0.018  # a fork's plate and crossbar, from the flange ahead
_LIP_M = 0.004  # thickness of a fork's channels

_GRID_M, _MOST_RAYS = 0.003, 50  # between rays, and how many lie side by side
_AROUND_M = 0.04  # how far beside the bodies rays pass
_HALF_M = (0.01, 0.007, 0.004)  # of what may fit through an opening, the stoutest first

Stroke = Callable[[Path, np.random.Generator], str]
Motion = Sequence[Pose]  # of a body: displacements in the world, one after another


P = ParamSpec("P")
R = TypeVar("R")


def _kept(find: Callable[Concatenate[Errand, P], R]) -> Callable[Concatenate[Errand, P], R]:
    @wraps(find)
    def look(errand: Errand, /, *args: P.args, **kwargs: P.kwargs) -> R:
        key = (find.__name__, *map(id, errand.things), repr((args, kwargs)))
        cache = errand.analysis.cache
        if key not in cache:
            cache[key] = find(errand, *args, **kwargs)
        return cast(R, cache[key])

    return look


def frame_of(way: Array) -> Pose:
    """Return the turn of a frame whose x points along ``way`` (3,), its y horizontal."""
    x, y, z = way / np.linalg.norm(way)
    yaw = np.arctan2(y, x) if np.hypot(x, y) > 1e-6 else 0.0
    return Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, -np.arcsin(np.clip(z, -1.0, 1.0)), yaw))


@dataclass(frozen=True, eq=False)
class Contact:
    """A point (3,) of a body where a rod of half width ``half`` gets, and how long it must be to stay outside."""

    point: Array
    half: float
    length: float


class _Rays:
    """Parallel rays through a scene, on a grid (U, V) around an errand's bodies, along x of ``turn``."""

    def __init__(self, errand: Errand, way: Array) -> None:
        self.turn = frame_of(way)
        points = self.turn.inverse().apply(errand.points)
        lower, upper = points.min(axis=0) - _AROUND_M, points.max(axis=0) + _AROUND_M
        counts = np.minimum(np.ceil((upper - lower)[1:] / _GRID_M).astype(int), _MOST_RAYS)
        self.axes = [np.linspace(lower[i + 1], upper[i + 1], counts[i]) for i in range(2)]
        self.steps = [float(axis[1] - axis[0]) for axis in self.axes]
        self.near, far = self._crossings(errand.boxes)
        self.other_near, other_far = self._crossings(errand.others)
        self.all = np.concatenate([self.near, self.other_near], axis=-1), np.concatenate([far, other_far], axis=-1)

    def _crossings(self, boxes: Boxes) -> tuple[Array, Array]:
        """Compute where each ray enters and leaves each box, (U, V, N); inf and -inf: it misses the box."""
        back = self.turn.rotation.as_matrix().T
        axes, centers = np.einsum("ij,njk->nik", back, boxes.axes), boxes.centers @ back.T
        u, v = np.meshgrid(*self.axes, indexing="ij")
        starts = np.stack([np.zeros_like(u), u, v], axis=-1)
        inside = np.einsum("nik,uvni->uvnk", axes, starts[:, :, None] - centers)
        slopes = np.where(np.abs(axes[:, 0]) < 1e-9, 1e-9, axes[:, 0])  # of a ray, along each of a box's axes
        one, other = (-boxes.halves - inside) / slopes, (boxes.halves - inside) / slopes
        near, far = np.minimum(one, other).max(axis=-1), np.maximum(one, other).min(axis=-1)
        missed = near >= far
        return np.where(missed, np.inf, near), np.where(missed, -np.inf, far)

    def window(self, half: float) -> tuple[int, ...]:
        """Return how many rays are within ``half`` of one, along both axes."""
        return tuple(2 * int(np.ceil(half / step)) + 1 for step in self.steps)

    def point(self, u: int, v: int, depth: float) -> Array:
        return self.turn.apply([depth, self.axes[0][u], self.axes[1][v]])

    def outside(self) -> Array:
        """Compute for each ray where the obstacles begin that are near it, (U, V)."""
        nearest: Array = minimum_filter(self.other_near.min(axis=-1, initial=np.inf), self.window(0.025))
        return nearest


@_kept
def pushed(errand: Errand, way: Array, pole: Array | None = None) -> list[Contact]:
    """Find where a rod can push the bodies along ``way``, the best first.

    That is in the middle; with a ``pole`` (2, 3), a point of an axis that they turn about, and its direction, it is
    where they go the farthest along the way.
    """
    rays = _Rays(errand, way)
    hit, blocked, outside = rays.near.min(axis=-1), rays.other_near.min(axis=-1, initial=np.inf), rays.outside()
    for half in _HALF_M:
        free = minimum_filter(blocked, rays.window(half + 0.002)) > hit + 0.01
        contacts = []
        for u, v in np.argwhere(np.isfinite(hit) & free).tolist():
            point, length = rays.point(u, v, hit[u, v]), float(np.clip(hit[u, v] - outside[u, v], 0.0, 0.4))
            across = np.linalg.norm(np.cross(way, point - errand.center))
            away = across if pole is None else -np.cross(pole[1], point - pole[0]) @ way
            contacts.append((float(away), Contact(point, half, length)))
        if contacts:
            return [contact for _, contact in sorted(contacts, key=lambda one: one[0])[: max(1, len(contacts) // 6)]]
    return []


@dataclass(frozen=True, eq=False)
class Under:
    """Where two tines get under bodies along a heading.

    They are ``apart`` on each side of the line through ``rear`` (3,), which is where the bodies begin, at the height of
    their underside. Below it there is a gap ``room``, up to ``depth`` ahead.
    """

    heading: float
    rear: Array
    apart: float
    room: float
    depth: float

    @property
    def worth(self) -> float:
        return min(self.depth, 0.06) + min(self.apart, 0.05) + self.room + float(self.rear[2])


@_kept
def under(errand: Errand, heading: float, tine: float) -> Under | None:
    """Find where tines ``tine`` wide get under the bodies along a heading: high, wide apart, and far ahead."""
    rays = _Rays(errand, UP)
    near, far = rays.all
    ahead, side = (axis[:2] for axis in axes_of(heading))
    u, v = np.meshgrid(*rays.axes, indexing="ij")
    places = rays.turn.apply(np.stack([np.zeros_like(u), u, v], axis=-1))[..., :2] - errand.center[:2]
    along, across = places @ ahead, np.abs(places @ side)
    found = list[Under]()
    levels = np.unique(rays.near[np.isfinite(rays.near)].round(3))
    for level in levels[:: -max(1, len(levels) // 12)]:
        low = np.abs(rays.near - level).min(axis=-1) < 0.0015  # an underside at this height
        for room in (0.02, 0.012, 0.006):
            full = ((near < level - 0.0016) & (far > level - room)).any(axis=-1)
            for apart in np.arange(0.0, float(across[low].max(initial=0.0)) + 1e-9, 2 * min(rays.steps)):
                lane = np.abs(across - apart) < tine / 2 + min(rays.steps)
                if not (lane & low).any():
                    continue
                rear = float(along[lane & low].min())
                stop = float(along[lane & full & (along > rear - _AROUND_M)].min(initial=1.0))
                front = float(along[lane & low & (along < stop)].max(initial=rear))
                if stop > rear and front - rear > 0.008:
                    at = np.array([*(errand.center[:2] + rear * ahead), level])
                    found.append(Under(heading, at, float(apart), room, front - rear))
    return max(found, key=lambda one: one.worth) if found else None


def suits(errand: Errand) -> bool:
    """Report whether the errand's only body hangs from a joint, is to be turned, or stands in or around another."""
    goal = errand.goal
    if goal is None or len(errand.things) > 1:
        return False
    lower, upper = errand.others.bounds
    held = (lower < errand.upper - 0.003) & (upper > errand.lower + 0.003)
    return goal.joint is not None or _turn(errand) is not None or bool(held.all(axis=1).any())


def guided(errand: Errand, rng: np.random.Generator) -> Head | None:
    """Make a head for an errand that `suits`; None: there is no way in."""
    assert errand.goal is not None
    if errand.goal.joint is not None:
        return mover(errand, rng)
    turn = _turn(errand)
    return carrier(errand, rng) if turn is None else tipper(errand, turn, rng)


def _turn(errand: Errand) -> tuple[Array, float] | None:
    """Compute the axis (3,) about which the bodies are to be turned, level or nearly so, and the angle."""
    if errand.goal is None or errand.goal.axis is None:
        return None
    now = errand.things[0].body.pose.rotation.apply(errand.goal.axis)
    now, wanted = now / np.linalg.norm(now), np.divide(errand.goal.points, np.linalg.norm(errand.goal.points))
    angle = float(np.arccos(np.clip(now @ wanted, -1.0, 1.0)))
    axis = np.cross(now, wanted)
    if angle < max(_TURNED, np.radians(errand.goal.tolerance_deg)) or abs(axis[2]) > 0.5 * np.linalg.norm(axis) + 1e-6:
        return None
    return axis, angle


def _choose_under(errand: Errand, headings: Sequence[float], width: float, rng: np.random.Generator) -> Under | None:
    """Choose at random among the places that are worth most; None: there is none."""
    places = [place for heading in headings if (place := under(errand, heading, width)) is not None]
    good = [place for place in places if place.worth > max(other.worth for other in places) - 0.03]
    return good[int(rng.integers(len(good)))] if good else None


def _tines(kind: str, spot: Under, width: float, thick: float, depth: float, stroke: Stroke) -> Head:
    """Two tines ahead of a wall, or a wide one; their upper faces are at z = 0."""
    across = 2 * spot.apart + width
    pieces = [box("wall", -0.004, 0.0, 0.015 - thick, (0.008, across, 0.03))]
    for number, side in enumerate((1.0, -1.0) if spot.apart > width / 2 else (0.0,), start=1):
        size = (depth + 0.008, width, thick)
        pieces.append(box(f"tine_{number}", (depth - 0.008) / 2, side * spot.apart, -thick / 2, size))
    return Head(kind, "guided", tuple(pieces), np.array([0.0, 0.0, 0.03 - thick]), depth, across, stroke=stroke)


def carrier(errand: Errand, rng: np.random.Generator) -> Head | None:
    """Tines that lift a body out of what it stands in, carry it over, and lower it at the goal."""
    width, high = 0.009, 0.2 * UP
    if any(errand.blocked(high, start, step=0.006) for start in (np.zeros(3), errand.shift + 0.004 * UP)):
        return None
    if (spot := _choose_under(errand, _QUARTERS, width, rng)) is None:
        return None
    ahead = axes_of(spot.heading)[0]
    gap = rng.uniform(0.01, 0.02)
    depth = gap + min(spot.depth, float(np.ptp(errand.points @ ahead)))

    def stroke(path: Path, rng: np.random.Generator) -> str:
        inside = spot.rear - gap * ahead - 0.001 * UP
        path.enter(errand, spot.heading, inside - (depth + 0.02) * ahead, inside)
        path.hold()
        lifted, goal = inside + 0.001 * UP, inside + 0.001 * UP + errand.shift
        over = [
            np.array([*place[:2], max(lifted[2], goal[2]) + 0.2 + rng.uniform(0.0, 0.03)]) for place in (lifted, goal)
        ]
        for place in (lifted, *over, goal, goal - rng.uniform(0.004, 0.012) * UP):
            length = float(np.linalg.norm(place - path.poses[-1].position))
            path.stroke(place, spot.heading, 0.15 if length > 0.02 else 1.0)
        path.go(spot.heading, path.poses[-1].position - (depth + 0.02) * ahead, touch=True)
        return "gets tines under the body, lifts it off, carries it over, lowers it and leaves"

    return _tines("tines", spot, width, min(0.008, spot.room / 2), depth, stroke)


def tipper(errand: Errand, turn: tuple[Array, float], rng: np.random.Generator) -> Head | None:
    """A lip that raises a body by one side, and turns it about its opposite edge."""
    axis, angle = turn
    headings, width = _QUARTERS, 0.016
    if np.linalg.norm(axis) > 0.2:
        x, y, _ = np.cross(axis, UP)
        headings = [float(np.arctan2(y, x))]
    if (spot := _choose_under(errand, headings, width, rng)) is None:
        return None
    ahead, thick = axes_of(spot.heading)[0], min(0.008, 0.6 * spot.room)
    grip = min(spot.depth * rng.uniform(0.5, 0.9), 0.04)
    gap = rng.uniform(0.006, 0.015)
    pivot = spot.rear + (errand.extent(spot.heading).front - spot.rear @ ahead) * ahead
    pivot[2] = errand.lower[2]
    radius = float((pivot - spot.rear) @ ahead) - grip
    most = angle + rng.uniform(0.0, 0.15) if angle < 2.0 else rng.uniform(1.7, 2.3)
    depth = grip + gap  # from the face to the tip

    def stroke(path: Path, rng: np.random.Generator) -> str:
        tip = spot.rear + grip * ahead - 0.001 * UP
        path.enter(errand, spot.heading, tip - depth * ahead - (depth + 0.02) * ahead, tip - depth * ahead)
        path.hold()
        rise = float(tip[2] - pivot[2])
        for turned in np.linspace(0.0, most, int(np.ceil(most / _STEP_RAD)) + 1)[1:]:
            arm = Rotation.from_rotvec(np.cross(UP, ahead) * turned).apply(-radius * ahead + rise * UP)
            path.go(spot.heading, pivot + arm - depth * ahead, touch=True)
        path.go(spot.heading, path.poses[-1].position - 0.06 * ahead + 0.02 * UP, touch=True)
        return f"raises one side by a lip, and turns the body about its other edge by {np.degrees(most):.0f} degrees"

    return _tines("lip", spot, width, thick, depth, stroke)


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
    if not contacts:
        return None
    contact = contacts[int(rng.integers(len(contacts)))]
    length, thick = contact.length + rng.uniform(0.04, 0.07), 2 * contact.half

    def stroke(path: Path, rng: np.random.Generator) -> str:
        tip = contact.point - way * rng.uniform(0.001, 0.004)
        path.enter(errand, frame_of(way), contact.point - way * (contact.length + 0.03), tip)
        end = path.follow(motion)
        path.go(end, end.position - way * 0.03, touch=True)
        return f"thrusts a rod of {length:.2f} m against the body, along the way that it is free to go"

    pieces = (box("rod", -length / 2, 0.0, 0.0, (length, thick, thick)),)
    return Head("rod", "guided", pieces, np.array([0.006 - length, 0.0, 0.0]), 0.0, thick, stroke=stroke)


def handles(errand: Errand) -> tuple[Errand, float, float] | None:
    """The bodies' loose container, if parts stand out of it on both sides: the errand of moving it as they are, the
    heading that is easiest to reach from the arm's side, and the container's half width without them. None: no such.
    """
    if errand.holder is None:
        return None
    pan = Errand((errand.holder,), errand.shift, errand.analysis)
    away = errand.space.direction(errand.holder.position)
    for heading in sorted(_QUARTERS, key=lambda turn: -np.cos(turn - away))[:2]:
        (out, halves), (right, left) = pan.overhang(heading), pan.boxes.extents(axes_of(heading)[1], pan.center)
        if (out & (left > 0)).any() and (out & (right < 0)).any() and not out.all():
            return pan, heading, float(halves[~out].max())
    return None


def pourer(errand: Errand, grips: tuple[Errand, float, float], rng: np.random.Generator, stout: float) -> Head:
    """Two channels, open toward each other, that slide over the handles of the bodies' container.

    It is lifted, carried to the goal and turned over there by the arm's last joint: the flange points ahead, and the
    head's frame is the flange's: x along the axis of that joint. The channels are ``drop`` below it, and ``stout``
    times as thick as usual.
    """
    pan, heading, base = grips
    (ahead, _), (out, halves), (lower, upper) = axes_of(heading), pan.overhang(heading), pan.boxes.bounds
    rear = float(((pan.points - pan.center) @ ahead).min())
    reach = float(pan.boxes.extents(ahead, pan.center)[1][out].max())
    low, high, outer = float(lower[out, 2].min()), float(upper[out, 2].max()), float(halves[out].max())
    lip = stout * _LIP_M
    drop, room = rng.uniform(0.07, 0.12), rng.uniform(0.002, 0.005)
    gap = rng.uniform(0.003, 0.012)  # between the crossbar and the container
    inner, side = base + 0.3 * (outer - base), outer + room
    length = reach - rear + gap + rng.uniform(-0.03, 0.015)
    width, tall = 2 * (side + lip), high - low + 2 * room
    pieces = [
        box("plate", 0.005, 0.0, -drop / 2, (0.01, 0.06, drop + 0.07)),
        box("crossbar", _BACK_M - 0.005, 0.0, -drop, (0.01, width, 0.03)),
    ]
    along = _BACK_M - 0.002 + length / 2
    for name, sign in SIDES:
        pieces.append(
            box(f"{name}_web", along, sign * (side + lip / 2), -drop, (length + 0.002, lip, tall + 2 * lip), 1)
        )
        for edge, up in (("lower", -1.0), ("upper", 1.0)):
            z, size = -drop + up * (tall + lip) / 2, (length + 0.002, side - inner + 0.002, lip)
            pieces.append(box(f"{name}_{edge}", along, sign * (inner + side) / 2, z, size, 1))

    def stroke(path: Path, rng: np.random.Generator) -> str:
        grasp = pan.center + (rear - gap - _BACK_M) * ahead
        grasp[2] = (low + high) / 2 + drop
        before = grasp - (length + rng.uniform(0.01, 0.03)) * ahead
        path.go(heading, before + rng.uniform(0.06, 0.15) * UP, before)
        path.stroke(grasp, heading, rng.uniform(0.1, 0.3))
        # High enough for the container to pass over everything near, upright and on its side.
        height = errand.clear_z + max(grasp[2] - pan.lower[2], float(np.ptp(pan.points[:, :2], axis=0).min()) / 2)
        height += rng.uniform(0.01, 0.06)
        path.stroke(np.array([*grasp[:2], height]), heading, rng.uniform(0.1, 0.3))
        path.hold()
        place = np.mean([thing.position for thing in errand.things], axis=0) + errand.shift
        there_heading = errand.space.direction(place) + rng.uniform(-0.5, 0.8)
        sign, turn = float(rng.choice([-1.0, 1.0])), rng.uniform(2.2, 3.0)
        onward, aside = axes_of(there_heading)
        there = place - (gap + _BACK_M - rear) * onward - sign * 0.5 * drop * aside
        there[2] = height
        path.stroke(there, there_heading, rng.uniform(0.15, 0.4))
        for share in np.linspace(0.0, 1.0, int(rng.integers(3, 7)) + 1)[1:]:
            path.add(Pose.xyz_rpy(there, (sign * share * turn, 0.0, there_heading)), touch=True)
        path.go(path.poses[-1], there + 0.02 * UP, there, there + 0.02 * UP, touch=True)
        carried = f"slides over the handles, lifts, carries by {errand.length:.2f} m"
        return f"{carried} and turns over by {np.degrees(turn):.0f} degrees"

    pose = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, np.pi / 2, 0.0))
    return Head("fork", "pour", tuple(pieces), np.zeros(3), length, width, stroke=stroke, pose=pose)

"""Strokes that follow from what holds a body: a joint, an enclosure, a peg; or from its turning or moving.

Each makes a head for one errand, and the head knows its own stroke: tines get under a body, to lift it off what goes
through it, or to turn it over its opposite edge; cages wait for bodies that move when the motion begins; rods and
hooks are in `plugins.vlms.offline.rods`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

import numpy as np
from scipy.spatial.transform import Rotation

from core.geometry import Array, Cylinder, Sphere
from plugins.vlms.offline.boxes import axes_of
from plugins.vlms.offline.heads import Head, Piece, box, cage
from plugins.vlms.offline.openings import Under, under, way_out
from plugins.vlms.offline.plans import Path
from plugins.vlms.offline.rods import drawer, mover
from plugins.vlms.offline.scene_analysis import UP, Errand, Thing

_TURNED = np.radians(20.0)  # a goal about an orientation that is farther off than this
_STEP_RAD = 0.15  # between waypoints
_QUARTERS: list[float] = (np.arange(4) * np.pi / 2).tolist()


def suits(errand: Errand) -> bool:
    """Report whether the errand's bodies move, hang from a joint, are to be turned, or are held by what is near."""
    if any(thing.body.launched for thing in errand.things):
        return True
    goal = errand.goal
    if goal is None or len(errand.things) > 1:
        return False
    return goal.joint is not None or _turn(errand) is not None or _threaded(errand) or _shut_in(errand)


def guided(errand: Errand, rng: np.random.Generator) -> Head | None:
    """Make a head for the way that `suits`; None: there is no way in."""
    if any(thing.body.launched for thing in errand.things):
        return catcher(errand, rng)
    if errand.goal is not None and errand.goal.joint is not None:
        return mover(errand, rng)
    if (turn := _turn(errand)) is not None:
        return tipper(errand, turn, rng)
    route = way_out(errand, np.zeros(3))
    if route is None:
        return None
    if errand.covered and abs(route[-1][2]) < 1e-6:
        return drawer(errand, route, rng)
    return carrier(errand, route, rng)


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


def _threaded(errand: Errand) -> bool:
    """Report whether another body stands within the bounds of the errand's, as a peg in a ring."""
    lower, upper = errand.lower + 0.003, errand.upper - 0.003
    return bool(((errand.others.lower < upper) & (errand.others.upper > lower)).all(axis=1).any())


def _shut_in(errand: Errand) -> bool:
    return errand.covered and errand.length > 0.03 and errand.blocked(errand.shift * [1.0, 1.0, 0.0])


def _tines(spot: Under, width: float, thick: float, depth: float, wall: float, nose: float) -> tuple[Piece, ...]:
    """Two tines ahead of a wall, or one wide one; their upper faces are at z = 0, noses at the tips stand above it."""
    sides = (1.0, -1.0) if spot.apart > width / 2 else (0.0,)
    across = 2 * spot.apart + width
    pieces = [box("wall", -0.004, 0.0, wall / 2 - thick, (0.008, across, wall))]
    for number, side in enumerate(sides):
        y = side * spot.apart
        pieces.append(box(f"tine_{number + 1}", (depth - 0.008) / 2, y, -thick / 2, (depth + 0.008, width, thick)))
        if nose > 0.0:
            pieces.append(
                box(f"nose_{number + 1}", depth - 0.002, y, nose / 2 - 0.001, (0.004, width, nose), len(pieces) - 1)
            )
    return tuple(pieces)


def _behind(errand: Errand, spot: Under, height: float) -> float:
    """Compute how far obstacles reach back from the bodies' rear, where a wall of this height would be."""
    ahead, side = (axis[:2] for axis in axes_of(spot.heading))
    others = errand.others
    signs = np.array([[x, y] for x in (-1, 1) for y in (-1, 1)])
    corners = others.centers[:, None, :2] + signs * others.reaches[:, None, :2] - spot.rear[:2]
    along, across = corners @ ahead, np.abs(corners.mean(axis=1) @ side) - np.ptp(corners @ side, axis=1) / 2
    near = (across < spot.apart + 0.02) & (others.lower[:, 2] < spot.rear[2] + height)
    near &= (others.upper[:, 2] > spot.rear[2] - 0.01) & (along.min(axis=1) < 0.0)
    return float(np.clip(-along[near].min(initial=0.0), 0.0, 0.25))


def _choose_under(errand: Errand, headings: Sequence[float], tine: float, rng: np.random.Generator) -> Under | None:
    """Choose at random among the places that are worth most; None: there is none."""
    places = [place for heading in headings if (place := under(errand, heading, tine)) is not None]
    good = [place for place in places if place.worth > max(other.worth for other in places) - 0.03]
    return good[int(rng.integers(len(good)))] if good else None


def carrier(errand: Errand, route: Sequence[Array], rng: np.random.Generator) -> Head | None:
    """Tines that lift a body off what goes through it, carry it over, and lower it at the goal."""
    tine = 0.009
    back = way_out(errand, errand.shift + 0.004 * UP)
    spot = None if back is None else _choose_under(errand, _QUARTERS, tine, rng)
    if back is None or spot is None:
        return None
    ahead, thick = axes_of(spot.heading)[0], min(0.008, spot.room / 2)
    nose = min(0.008, spot.room - thick - 0.003)
    nose = nose if nose > 0.002 else 0.0
    reach = float(np.ptp(errand.points @ ahead))
    gap = _behind(errand, spot, 0.05) + rng.uniform(0.01, 0.02)
    depth = gap + min(spot.depth, reach) + (0.012 if nose else 0.0)
    pieces = _tines(spot, tine, thick, depth, 0.03, nose)

    def stroke(path: Path, rng: np.random.Generator) -> str:
        inside = spot.rear - gap * ahead - (nose + 0.001) * UP
        before = inside - (depth + 0.02) * ahead
        path.enter(errand, spot.heading, before, inside)
        path.hold()
        lifted = inside + (nose + 0.001) * UP
        goal = lifted + errand.shift
        places, down = [*accumulate(route, initial=lifted)], [*accumulate(back, initial=goal)][::-1]
        high = max(places[-1][2], down[0][2]) + rng.uniform(0.0, 0.03)
        places += [np.array([*places[-1][:2], high]), np.array([*down[0][:2], high])]
        places += [*down, goal - (nose + rng.uniform(0.004, 0.012)) * UP]
        for place in places:
            length = float(np.linalg.norm(place - path.poses[-1].position))
            path.stroke(place, spot.heading, 0.15 if length > 0.02 else 1.0)
        path.go(spot.heading, places[-1] - (depth + 0.02) * ahead, touch=True)
        return "gets tines under the body, lifts it off, carries it over, lowers it and leaves"

    return Head(
        "tines", "guided", pieces, np.array([0.0, 0.0, 0.03 - thick]), depth, 2 * spot.apart + tine, stroke=stroke
    )


def tipper(errand: Errand, turn: tuple[Array, float], rng: np.random.Generator) -> Head | None:
    """A lip that raises a body by one side, and turns it about its opposite edge."""
    axis, angle = turn
    headings = _QUARTERS
    if np.linalg.norm(axis) > 0.2:
        x, y, _ = np.cross(axis, UP)
        headings = [float(np.arctan2(y, x))]
    tine = 0.016
    if (spot := _choose_under(errand, headings, tine, rng)) is None:
        return None
    ahead, thick = axes_of(spot.heading)[0], min(0.008, 0.6 * spot.room)
    grip = min(spot.depth * rng.uniform(0.5, 0.9), 0.04)
    gap = rng.uniform(0.006, 0.015)
    _, front = errand.span(spot.heading)
    pivot = spot.rear + (front - spot.rear @ ahead) * ahead
    pivot[2] = errand.lower[2]
    radius = float((pivot - spot.rear) @ ahead) - grip
    most = angle + rng.uniform(0.0, 0.15) if angle < 2.0 else rng.uniform(1.7, 2.3)

    def stroke(path: Path, rng: np.random.Generator) -> str:
        tip = spot.rear + grip * ahead - 0.001 * UP
        offset = (grip + gap) * ahead  # from the face to the tip
        path.enter(errand, spot.heading, tip - offset - (grip + gap + 0.02) * ahead, tip - offset)
        path.hold()
        rise = float(tip[2] - pivot[2])
        for turned in np.linspace(0.0, most, int(np.ceil(most / _STEP_RAD)) + 1)[1:]:
            arm = Rotation.from_rotvec(np.cross(UP, ahead) * turned).apply(-radius * ahead + rise * UP)
            path.go(spot.heading, pivot + arm - offset, touch=True)
        path.go(spot.heading, path.poses[-1].position - 0.06 * ahead + 0.02 * UP, touch=True)
        return f"raises one side by a lip, and turns the body about its other edge by {np.degrees(most):.0f} degrees"

    pieces = _tines(spot, tine, thick, grip + gap, 0.03, 0.0)
    return Head("lip", "guided", pieces, np.array([0.0, 0.0, 0.03 - thick]), grip + gap, tine, stroke=stroke)


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

    def stroke(path: Path, rng: np.random.Generator) -> str:
        path.enter(errand, heading, face)
        path.go(heading, *[face] * int(np.clip(np.ceil((late - 1.5) / 0.5), 1, 30)), touch=True)
        path.hold()
        if np.linalg.norm(rest) > 0.02:
            path.stroke(face + rest, heading, 0.1)
            path.go(heading, face + rest, touch=True)
        ahead = meet - (positions @ way).mean()
        return f"waits for {late:.1f} s with a cage, open to what comes, {ahead:.2f} m ahead of it"

    made = cage(width, depth, height, float(rng.uniform(0.005, 0.01)), float(rng.uniform(0.0, 0.3)))
    return Head("catcher", "guided", made.pieces, made.hold, depth, width, stroke=stroke)

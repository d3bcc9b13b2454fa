"""Tines that get under a body: to lift it off what goes through it, or to turn it over its opposite edge."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from plugins.vlms.offline.heads import Head, Piece, box
from plugins.vlms.offline.openings import Under, under, way_out
from plugins.vlms.offline.plans import Path
from plugins.vlms.offline.scene_analysis import UP, Errand

_STEP_RAD = 0.15  # between waypoints


def enter(path: Path, errand: Errand, pose: Pose) -> None:
    """Come down from above everything near."""
    rise = max(0.03, errand.clear_z - float(pose.position[2]) + 0.03)
    path.add(Pose(pose.position + rise * UP, pose.quaternion))
    path.add(pose)


def _tines(at: Under, width: float, thick: float, depth: float, wall: float, nose: float) -> tuple[Piece, ...]:
    """Two tines ahead of a wall, or one wide one; their upper faces are at z = 0, noses at the tips stand above it."""
    sides = (1.0, -1.0) if at.apart > width / 2 else (0.0,)
    across = 2 * at.apart + width
    pieces = [box("wall", -0.004, 0.0, wall / 2 - thick, (0.008, across, wall))]
    for number, side in enumerate(sides):
        y = side * at.apart
        pieces.append(box(f"tine_{number + 1}", (depth - 0.008) / 2, y, -thick / 2, (depth + 0.008, width, thick)))
        if nose > 0.0:
            pieces.append(
                box(f"nose_{number + 1}", depth - 0.002, y, nose / 2 - 0.001, (0.004, width, nose), len(pieces) - 1)
            )
    return tuple(pieces)


def _behind(errand: Errand, at: Under, height: float) -> float:
    """Compute how far obstacles reach back from the bodies' rear, where a wall of this height would be."""
    ahead = at.ahead[:2]
    side = np.array([-ahead[1], ahead[0]])
    others = errand.others
    signs = np.array([[x, y] for x in (-1, 1) for y in (-1, 1)])
    corners = others.centers[:, None, :2] + signs * others.reaches[:, None, :2] - at.rear[:2]
    along, across = corners @ ahead, np.abs(corners.mean(axis=1) @ side) - np.ptp(corners @ side, axis=1) / 2
    near = (across < at.apart + 0.02) & (others.lower[:, 2] < at.rear[2] + height)
    near &= (others.upper[:, 2] > at.rear[2] - 0.01) & (along.min(axis=1) < 0.0)
    return float(np.clip(-along[near].min(initial=0.0), 0.0, 0.25))


def _unders(errand: Errand, headings: Sequence[float], tine: float) -> list[Under]:
    return [one for heading in headings if (one := under(errand, heading, tine)) is not None]


def _chosen(found: Sequence[Under], rng: np.random.Generator) -> Under:
    """Choose at random among those that are worth most."""
    best = max(one.worth for one in found)
    good = [one for one in found if one.worth > best - 0.03]
    return good[int(rng.integers(len(good)))]


def carrier(errand: Errand, route: Sequence[Array], rng: np.random.Generator) -> Head | None:
    """Tines that lift a body off what goes through it, carry it over, and lower it at the goal."""
    tine = 0.009
    found = _unders(errand, (np.arange(4) * np.pi / 2).tolist(), tine)
    back = way_out(errand, errand.shift + 0.004 * UP)
    if not found or back is None:
        return None
    at = _chosen(found, rng)
    thick = min(0.008, at.room / 2)
    nose = min(0.008, at.room - thick - 0.003)
    nose = nose if nose > 0.002 else 0.0
    reach = float(np.ptp(errand.points @ at.ahead))
    gap = _behind(errand, at, 0.05) + rng.uniform(0.01, 0.02)
    depth = gap + min(at.depth, reach) + (0.012 if nose else 0.0)
    pieces = _tines(at, tine, thick, depth, 0.03, nose)
    ahead = at.ahead

    def along(path: Path, rng: np.random.Generator) -> str:
        inside = at.rear - gap * ahead - (nose + 0.001) * UP
        before = inside - (depth + 0.02) * ahead
        enter(path, errand, Pose.xyz_rpy(before, (0.0, 0.0, at.heading)))
        path.go(inside, at.heading)
        path.hold()
        lifted = inside + (nose + 0.001) * UP
        places, here = [lifted], lifted
        for leg in route:
            here = here + leg
            places.append(here)
        goal = lifted + errand.shift
        down = [goal]
        for leg in back:
            down.insert(0, down[0] + leg)
        high = max(places[-1][2], down[0][2])
        high += rng.uniform(0.0, 0.03)
        for place in (np.array([*places[-1][:2], high]), np.array([*down[0][:2], high])):
            places.append(place)
        places += [*down, goal - (nose + rng.uniform(0.004, 0.012)) * UP]
        for place in places:
            length = float(np.linalg.norm(place - path.poses[-1].position))
            path.stroke(place, at.heading, 0.15 if length > 0.02 else 1.0)
        path.go(places[-1] - (depth + 0.02) * ahead, at.heading, touch=True)
        return "gets tines under the body, lifts it off, carries it over, lowers it and leaves"

    return Head("tines", "guided", pieces, np.array([0.0, 0.0, 0.03 - thick]), depth, 2 * at.apart + tine, way=along)


def tipper(errand: Errand, turn: tuple[Array, float], rng: np.random.Generator) -> Head | None:
    """A lip that raises a body by one side, and turns it about its opposite edge."""
    axis, angle = turn
    headings = (np.arange(4) * np.pi / 2).tolist()
    if np.linalg.norm(axis) > 0.2:
        x, y, _ = np.cross(axis, UP)
        headings = [float(np.arctan2(y, x))]
    tine = 0.016
    found = _unders(errand, headings, tine)
    if not found:
        return None
    at = _chosen(found, rng)
    ahead, thick = at.ahead, min(0.008, 0.6 * at.room)
    grip = min(at.depth * rng.uniform(0.5, 0.9), 0.04)
    gap = rng.uniform(0.006, 0.015)
    _, front = errand.span(at.heading)
    pivot = at.rear + (front - at.rear @ ahead) * ahead
    pivot[2] = errand.lower[2]
    radius = float((pivot - at.rear) @ ahead) - grip
    most = angle + rng.uniform(0.0, 0.15) if angle < 2.0 else rng.uniform(1.7, 2.3)

    def along(path: Path, rng: np.random.Generator) -> str:
        tip = at.rear + grip * ahead - 0.001 * UP
        offset = (grip + gap) * ahead  # from the face to the tip
        enter(path, errand, Pose.xyz_rpy(tip - offset - (grip + gap + 0.02) * ahead, (0.0, 0.0, at.heading)))
        path.go(tip - offset, at.heading)
        path.hold()
        rise = float(tip[2] - pivot[2])
        for turned in np.linspace(0.0, most, int(np.ceil(most / _STEP_RAD)) + 1)[1:]:
            arm = Rotation.from_rotvec(np.cross(UP, ahead) * turned).apply(-radius * ahead + rise * UP)
            path.go(pivot + arm - offset, at.heading, touch=True)
        path.go(path.poses[-1].position - 0.06 * ahead + 0.02 * UP, at.heading, touch=True)
        return f"raises one side by a lip, and turns the body about its other edge by {np.degrees(most):.0f} degrees"

    pieces = _tines(at, tine, thick, grip + gap, 0.03, 0.0)
    return Head("lip", "guided", pieces, np.array([0.0, 0.0, 0.03 - thick]), grip + gap, tine, way=along)

"""Say what in a scene is possible, and yet seldom meant: mixed up units, and bodies in the air."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from core.geometry import Pose, Vector
from core.goals import Goal, Reach, numbered
from core.scene import Body, Camera, Scene, State
from core.solids.standing import bound, find_falls, find_fast, list_held, turn_upright
from core.values.warnings import find_warning

SEEN = 0.9  # of half a picture's height: what is farther from its middle is hardly seen
HELD_M = 0.01  # a bond holds a point of a body, not one farther from it
# Of an eighth of a turn: 1.57 and 0.785 are so near to what they stand for.
ROUNDED = 0.005
_UPRIGHT = re.compile(
    r"\b(upright|tip(s|ping|ped)? over|tilt(s|ing|ed)?)\b", re.IGNORECASE
)
FAR_M = 1.6  # beyond the reach of the longest arms, 1.3 m, with a tool of 0.3 m


def find_warnings(scene: Scene) -> Iterator[str]:
    """Yield a line for each thing that is seldom meant."""
    held = list_held(scene)
    for body in scene.free:
        if not body.collides:
            continue

        low, high = bound(body)
        where = f"body {body.name}"
        yield from find_warning(where, "body mass", body.mass)
        yield from find_warning(where, "length", float((high - low).max()))
        volume = sum(geom.shape.volume for geom in body.collisions)
        if volume > 0:
            yield from find_warning(where, "density", body.mass / volume)

        weight = body.mass * float(np.linalg.norm(scene.gravity))
        if 0 < body.breaks_n < weight and body.name not in held:
            yield f"body {body.name} weighs {weight:.3g} N, and breaks at {body.breaks_n:g} N where it lies"

    yield from (fault.text for fault in find_falls(scene))
    yield from find_fast(scene)


def find_far_bonds(scene: Scene) -> Iterator[str]:
    """Yield a line for each bond that holds a body by a point far from it: its origin may be meant in the world."""
    for bond in scene.bonds:
        body = scene[bond.body]
        low, high = bound(replace(body, pose=Pose()))
        origin = np.array(bond.origin)
        away = float(np.linalg.norm(origin - np.clip(origin, low, high)))
        if away > HELD_M:
            yield (
                f"bond {bond.name} holds {bond.body} by a point {1000 * away:.0f} mm from it; its origin is in the "
                "frame of the body"
            )


def find_unrewarded(description: str, goals: Sequence[Goal]) -> Iterator[str]:
    """Yield a line where a description says how a body is to stand, and no goal asks how one is turned."""
    said = _UPRIGHT.search(description)
    parts = [part for goal in goals for part in goal.parts]
    if said and not any(part.orients for part in parts):
        yield (
            f"the description says {said[0]!r}, and no goal asks how a body is turned, so it earns nothing; add a goal "
            "such as {bodies: [NAME], axis: [0, 0, 1], tolerance_deg: 10, throughout: true}"
        )


def find_radians(turns: Mapping[str, Vector]) -> Iterator[str]:
    """Yield a line for each turn, degrees, that is a quarter or half of one in radians; ``turns`` by what turns."""
    for name, angles in turns.items():
        for angle in angles:
            quarters = abs(angle) / (np.pi / 4)
            count = round(quarters)
            if 0 < count <= 4 and abs(quarters - count) < ROUNDED:
                yield (
                    f"{name} has rpy_deg {angle:g}, which are degrees: {count * 45} degrees are {angle:g} radians"
                )
                break


def find_foot(scene: Scene, body: Body) -> float:
    """Measure how far the frame of a body is above its lowest point as gravity draws, m."""
    if not body.collides:
        return 0.0

    turned = replace(body, pose=turn_upright(scene.gravity) @ body.pose)
    low, _ = bound(turned)
    return float(turned.spawn.position[2] - low[2])


def find_idle_goals(scene: Scene, goals: Sequence[Goal], every: bool) -> Iterator[str]:
    """Yield a line for each goal that asks for less, or for more, than is seldom meant."""
    state = scene.state()
    wanted = numbered(goals)
    weights = sum(goal.weight for goal in wanted.values())

    for number, goal in enumerate(goals):
        where = f"goal {number}"
        if number in wanted:
            where = wanted[number].label(number)
            share = wanted[number].weight / weights if every else 1.0
            yield from _warn_of_ends(wanted[number], where, share, state)

        for part in goal.parts:
            yield from part.find_warnings(where, scene)


def _warn_of_ends(goal: Reach, where: str, share: float, state: State) -> Iterator[str]:
    """Yield a line where a goal is met at the start, which earns a share, wants one body of several, or is far."""
    borne = goal.held or bool(goal.stands_on)
    met = not borne and bool(goal.progress(state, state) >= 1.0)
    if met and goal.after is None:
        yield f"{where} is met at the start: doing nothing earns {share:.2g}"

    if type(goal.enough) is int and goal.enough == 1 < len(goal.bodies):
        yield (
            f"{where} has enough: 1, which is one body of {len(goal.bodies)}; for all of them leave it out"
        )

    for body in goal.subjects(state):
        place = goal.place_of(body, state)
        if place is None:
            continue

        known = np.where(np.isnan(place), 0.0, place)
        way = float(np.hypot(*known[:2]))
        if way > FAR_M:
            yield f"{where} is {way:.3g} m from the robot: few arms bring a body so far"
            return


def find_unseen(camera: Camera, state: State, names: Iterable[str]) -> list[str]:
    """Return the bodies whose middles are not in a camera's picture, or so near its edge that most of them is not."""
    most = SEEN * np.tan(np.radians(camera.fov_deg) / 2)
    unseen = []
    for name in names:
        right, up, forward = camera.axes @ (state.position(name) - camera.position)
        if forward <= 0 or abs(up) > most * forward or abs(right) > most * forward:
            unseen.append(name)

    return unseen

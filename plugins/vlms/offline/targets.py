"""Say where a task's goals want bodies in a layout, as the embedded designer plans for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from core.geometry import Array, Pose, Vector
from core.goals import (
    Away,
    Broken,
    Facing,
    Goal,
    JointAt,
    Kept,
    Reach,
    Span,
    Turned,
    Untouched,
    limits,
)
from core.scene import Scene
from core.values.states import State

_FAR_DEG = 100.0  # plans aim by a tenth of it within a span of angles
_OVER_DEG = 120.0  # a turn by more is one over an edge
_LEAST_OFF_DEG = 3.0
_ALONG = 1e-3  # of a vector across a pole: it is along it

_FAR_M = 0.3  # and of distances between bodies

Wanted = dict[str, object]
Place = tuple[float | None, float | None, float | None]
"""Where a body's frame is to end, m; None: the coordinate is free."""


@dataclass(frozen=True)
class Target:
    """Where a goal wants bodies in a layout, in the world.

    Attributes:
        any: whether one of the bodies is enough.
        held: whether they must end in hand.
        released: whether they must end touched by nothing of the robot.
        rest: whether they must end at rest.
        place: of each body's frame, m; None: anywhere.
        away: how far each is to get from its start, m.
        axis: an axis of the bodies' frames that is to end along ``points``, within ``tolerance_deg`` degrees.
        joint: that is to get ``to`` a position, m or rad.
        later: positions that the joint is to get to after that, one after another.
        reference: the body or mark by which place and points are given.
        container: the body in whose hollow they are to end; None: there is none.
        breaks: whether a force on them is to break them, or a bond that holds them.
        steady: whether an axis of theirs must point the same way all the time.
        ever: whether it is enough to be there at some time, so that they may be let back.
        over_edge: whether the place is beyond an edge, over which they fall.
        number: of the goal among those of the task.
        after: the number of the goal that must be reached before it; None: there is none.
    """

    bodies: tuple[str, ...]
    any: bool = False
    held: bool = False
    released: bool = False
    rest: bool = False
    place: Place | None = None
    away: float | None = None
    axis: Vector | None = None
    points: Vector = (0.0, 0.0, 1.0)
    tolerance_deg: float = 10.0
    joint: str | None = None
    to: float = 0.0
    later: tuple[float, ...] = ()
    reference: str | None = None
    container: str | None = None
    breaks: bool = False
    steady: bool = False
    ever: bool = False
    over_edge: bool = False
    number: int = 0
    after: int | None = None


def find_targets(goal: Reach, scene: Scene) -> list[Target]:
    """Find the targets of a goal in a layout: one for all bodies that it wants at one place."""
    state = scene.state()
    groups = dict[Place | None, list[str]]()

    stays = _find_those_that_stay(goal, state)
    for body in goal.subjects(state):
        if body in stays:
            continue

        groups.setdefault(_find_place(goal, body, state), []).append(body)

    wanted: Wanted = {"ever": goal.ever}
    for part in goal.parts:
        reference = getattr(part, "at", None)
        if reference is not None:
            wanted["reference"] = reference

        inside = getattr(part, "inside", None)
        if inside is not None and scene[inside].collisions:
            wanted["container"] = inside

        if is_planned(part):
            read = READERS.get(type(part), _read_nothing)
            if _angles(part) is not None:
                read = _read_turn_by

            wanted |= read(part, scene)

    return [
        Target(
            tuple(bodies),
            goal.any,
            goal.held,
            goal.released,
            goal.rest,
            place,
            **wanted,  # type: ignore[arg-type]
        )
        for place, bodies in groups.items()
    ]


def find_steady(goals: Iterable[Goal], scene: Scene) -> set[str]:
    """Name the bodies of which an axis must point the same way all the time.

    Args:
        goals: of a task; limits of any kind may be among them.
        scene: which has the bodies.
    """
    names: set[str] = set()
    for limit in limits(goals):
        lasting = getattr(limit, "what", None)
        if isinstance(lasting, Reach) and any(
            isinstance(part, Turned) for part in lasting.parts
        ):
            names |= {*lasting.subjects(scene.state())}

    return names


def turn_over(target: Target, turn: Pose) -> Target:
    """Turn a target over, by half a turn about a line along the world's y.

    Args:
        target: in the world.
        turn: after which x and z have changed their signs, from where the line is.
    """
    points = turn.rotation.apply(target.points).round(9).tolist()
    if target.place is None:
        return replace(target, points=tuple(points))

    place = [0.0 if wanted is None else wanted for wanted in target.place]
    turned = turn.apply(np.array(place)).tolist()
    x, y, z = (
        None if wanted is None else coordinate
        for wanted, coordinate in zip(target.place, turned, strict=True)
    )
    return replace(target, place=(x, y, z), points=tuple(points))


def is_planned(goal: Goal) -> bool:
    """Report whether plans mind a part of a goal, or a limit; what they do not is named when a run starts.

    Of what is to be reached they mind the kinds that `READERS` has, and those that say a place. Their faults are where
    the tool meets what it need not move, so that other things are left alone and in place.
    """
    if isinstance(goal, Kept):
        return True
    if isinstance(goal, Untouched):
        return not (goal.by or goal.max_force_n)
    if type(goal) in READERS:
        return True
    if _spaces(goal) is not None or _angles(goal) is not None:
        return True

    return isinstance(goal, Reach) and type(goal).place_of is not Reach.place_of


def _read_nothing(part: Reach, scene: Scene) -> Wanted:
    """Read no more than its place, and how its bodies are to end."""
    return {}


def _read_away(part: Away, scene: Scene) -> Wanted:
    return {"away": part.away}


def _read_broken(part: Broken, scene: Scene) -> Wanted:
    return {"breaks": True}


def _read_joint(part: JointAt, scene: Scene) -> Wanted:
    return {"joint": part.joint, "to": part.aim(scene.state())}


def _read_turn(part: Turned, scene: Scene) -> Wanted:
    points = part.points
    if part.at is not None:
        points = scene[part.at].pose.rotation.apply(points)

    wanted: Wanted = {
        "axis": part.axis,
        "points": points,
        "tolerance_deg": part.tolerance_deg,
    }
    if part.angle_deg is None:
        return wanted

    # Of all directions at that angle, the nearest to where the first body's axis points now.
    body = scene[part.subjects(scene.state())[0]]
    now = _unit(body.pose.rotation.apply(part.axis))
    pole = _unit(np.asarray(points))
    angle = float(np.degrees(np.arccos(np.clip(now @ pole, -1.0, 1.0))))
    aim = part.angle_deg.aim(angle, _FAR_DEG)

    away = now - (now @ pole) * pole
    if np.linalg.norm(away) < _ALONG:
        away = _find_aside(pole, body.pose.position)

    turned = np.cos(np.radians(aim)) * pole + np.sin(np.radians(aim)) * _unit(away)
    off = abs(part.angle_deg.aim(angle, 0.0) - aim)
    return wanted | {"points": tuple(turned.tolist()), "tolerance_deg": off}


def _read_facing(part: Facing, scene: Scene) -> Wanted:
    """Read a turn on the level, from where the first body is to what it is to face."""
    body = scene[part.subjects(scene.state())[0]]
    way = scene[part.facing].pose.position - body.pose.position
    if np.hypot(*way[:2]) < _ALONG:
        return {}

    return {
        "axis": part.axis,
        "points": (float(way[0]), float(way[1]), 0.0),
        "tolerance_deg": part.tolerance_deg,
    }


def _read_turn_by(part: Reach, scene: Scene) -> Wanted:
    """Read a turn by an angle, about whatever axis: over where that is far, and else about the vertical."""
    angles = _angles(part)
    assert angles is not None
    body = scene[part.subjects(scene.state())[0]]
    least = angles.aim(0.0, 0.0)
    angle = np.radians(angles.aim(0.0 if least < _OVER_DEG else 180.0, _FAR_DEG))

    back = body.pose.rotation.inv()
    now = np.array([1.0, 0.0, 0.0])
    points = np.array([np.cos(angle), np.sin(angle), 0.0])
    if least >= _OVER_DEG:
        now = np.array([0.0, 0.0, 1.0])
        points = np.array([np.sin(angle), 0.0, np.cos(angle)])

    off = np.degrees(angle) - least
    return {
        "axis": tuple(back.apply(now).tolist()),
        "points": tuple(points.tolist()),
        "tolerance_deg": float(max(abs(off), _LEAST_OFF_DEG)),
    }


def _find_aside(pole: Array, position: Array) -> Array:
    """Find a direction (3,) across a pole: away from the world's middle, or up where that is along the pole.

    Args:
        pole: unit vector (3,).
        position: of the body, (3,).
    """
    outward = np.array([position[0], position[1], 0.0])
    for way in (outward, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])):
        across = way - (way @ pole) * pole
        if np.linalg.norm(across) > _ALONG:
            return np.asarray(across)

    raise AssertionError("one of two axes is across any pole")


def _unit(vector: Array) -> Array:
    """Return a vector (3,) of length 1 along a given one."""
    return np.asarray(vector / np.linalg.norm(vector))


READERS: Mapping[type[Goal], Callable[..., Wanted]] = {
    Reach: _read_nothing,
    Away: _read_away,
    Broken: _read_broken,
    Facing: _read_facing,
    JointAt: _read_joint,
    Turned: _read_turn,
}
"""What plans read of a kind of goal, beside its place: attributes of a `Target`."""


def _find_place(
    goal: Reach,
    body: str,
    state: State,
) -> Place | None:
    """Return where a goal, or what it also asks, wants a body; None: it says no place."""
    places = [part.place_of(body, state) for part in goal.parts]
    places += [_find_place_apart(part, body, state) for part in goal.parts]
    place = next((place for place in places if place is not None), None)
    if place is None:
        return None

    x, y, z = (None if np.isnan(wanted) else wanted for wanted in place.tolist())

    return x, y, z


def _spaces(goal: Goal) -> Span | None:
    """Return how far bodies are to be from each other, m; None: the goal asks no such thing."""
    spaces: Span | None = getattr(goal, "apart", None)
    return None if getattr(goal, "nodes", ()) else spaces


def _angles(goal: Goal) -> Span | None:
    """Return by which angle bodies are to be turned from their start, degrees; None: the goal asks no such thing."""
    angles: Span | None = getattr(goal, "turned_deg", None)
    return angles


def _find_those_that_stay(goal: Reach, state: State) -> tuple[str, ...]:
    """Find whom others get away from, or near to: the first body, where nothing else is asked of it."""
    asked = [part for part in goal.parts if _spaces(part) is None and _says_more(part)]
    spaced = [part for part in goal.parts if _spaces(part) is not None]
    if asked or not spaced:
        return ()

    return goal.subjects(state)[:1]


def _says_more(part: Reach) -> bool:
    """Report whether a part of a goal asks more than how bodies end."""
    return type(part) is not Reach


def _find_place_apart(goal: Reach, body: str, state: State) -> Array | None:
    """Find where a body ends if all go from the first one, or toward it, by the same factor; None: that is not asked.

    Args:
        goal: or a part of one.
        body: one of its bodies.
        state: at the start.
    """
    spaces = _spaces(goal)
    if spaces is None:
        return None

    places = np.array([state.position(name) for name in goal.subjects(state)])
    gaps = np.linalg.norm(places[:, None] - places, axis=-1)
    np.fill_diagonal(gaps, np.inf)
    nearest = float(gaps.min())

    factor = spaces.aim(nearest, _FAR_M) / max(nearest, 1e-6)
    place = places[0] + factor * (state.position(body) - places[0])
    return np.array([place[0], place[1], np.nan])

"""Find goals that nothing could ever meet, or that ask nothing, and say what was probably meant."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from core.errors import UsageError
from core.geometry import Primitive
from core.goals import (
    Away,
    Broken,
    Goal,
    Inside,
    JointAt,
    Kept,
    Placed,
    Reach,
    Span,
    Turned,
    TurnedBy,
    Unbroken,
    Untouched,
    reaches,
)
from core.scene import FIXTURE, Scene

HALF_TURN_DEG = 180.0
"""The largest angle between two directions."""

_ROUNDING = 1e-9
_MOVED = (Placed, Away, Inside)  # kinds that say how far a body itself has to get

Numbered = Sequence[tuple[int, Goal]]
"""Goals, each with the number of its entry in the file."""


def check_meetable(goal: Reach, scene: Scene) -> None:
    """Refuse a goal that can't be met by itself, or that asks nothing.

    Raises:
        UsageError: says why, and what to write.
    """
    for part in goal.parts:
        if isinstance(part, JointAt):
            _check_range(part, scene)
        if isinstance(part, Turned | TurnedBy):
            _check_angle(part)
        if isinstance(part, Placed):
            _check_place(part)
        if isinstance(part, Inside) and part.inside in goal.bodies:
            raise UsageError(f"{part.inside} can't be inside itself; name another body")


def _check_range(goal: JointAt, scene: Scene) -> None:
    """Refuse positions that a joint does not get to."""
    (joint,) = [joint for joint in scene.joints if joint.name == goal.joint]
    wanted = goal.span or Span.about(goal.to, goal.tolerance)
    begin = joint.start if goal.relative else 0.0
    lowest = joint.lower
    highest = joint.upper
    if joint.kind == "ball":  # its position is the angle that it was turned by
        lowest = 0.0
        highest = math.pi

    too_high = begin + wanted.low > highest + _ROUNDING
    too_low = begin + wanted.high < lowest - _ROUNDING
    if too_high or too_low:
        unit = "m" if joint.kind == "slider" else "rad"
        raise UsageError(
            f"joint {joint.name} starts at {joint.start:g} and goes from {lowest:g} to {highest:g} {unit}, and never "
            "there; ask for less, or give the joint a wider range"
        )


def _check_angle(goal: Turned | TurnedBy) -> None:
    """Refuse angles that there are not between two directions, or turns."""
    wanted = goal.angle_deg if isinstance(goal, Turned) else goal.turned_deg
    if wanted is None:
        return
    if wanted.low > HALF_TURN_DEG or wanted.high < 0:
        raise UsageError(
            "an angle goes from 0 to 180 degrees, whatever its direction, and so never there; write it within these"
        )


def _check_place(goal: Placed) -> None:
    """Refuse a place of which every coordinate is free."""
    places = goal.places or (goal.place or (),)
    for place in places:
        if all(wanted is None for wanted in place):
            raise UsageError(
                "a place or a way with null for all of x, y and z asks nothing; give one of them, such as [0.6, null, "
                "null]"
            )


def find_too_wide(goals: Sequence[Goal], scene: Scene) -> Iterator[str]:
    """Yield a line for each body that does not get into the hollow that it is to end in.

    A body of one round or square shape is looked at, by its smallest side; a design's fixture is not known.
    """
    state = scene.state()
    for goal in reaches(goals):
        for part in goal.parts:
            if not isinstance(part, Inside) or part.inside == FIXTURE:
                continue

            widest = 2 * part.space.passage
            for name in goal.bodies:
                shapes = [geom.shape for geom in scene[name].collisions]
                # Those in which a ball fits that is as wide as their smallest side.
                is_known = len(shapes) == 1 and isinstance(shapes[0], Primitive)
                if not is_known or goal.progress(state, state) >= 1.0:
                    continue

                _, sides = shapes[0].bounds
                if float(min(sides)) > widest:
                    way = f"the way in is at most {1000 * widest:.0f} mm wide"
                    if not widest:
                        way = "no way leads in"
                    yield f"{name} does not get into {part.inside}: {way}"


def find_circle(after: Mapping[int, int]) -> int | None:
    """Find an entry that has to be fulfilled before itself, by which comes after which; None: there is none."""
    for first in after:
        number = first
        for _ in after:
            number = after.get(number, -1)
            if number == first:
                return first

    return None


def find_conflicts(goals: Numbered, scene: Scene) -> Iterator[tuple[int, str]]:
    """Yield entries that ask what another one forbids, and why they can't be met together."""
    limits = [goal for _, goal in goals]
    for number, goal in goals:
        for wanted in reaches([goal]):
            for limit in limits:
                problem = _find_conflict(wanted, limit, scene)
                if problem:
                    yield number, problem


def _find_conflict(wanted: Reach, limit: Goal, scene: Scene) -> str:
    """Say why a limit does not let a goal be reached; empty: it does."""
    if isinstance(limit, Unbroken) and isinstance(wanted, Broken):
        spared = {*wanted.broken} & {*limit.unbroken}
        if _needs_some(wanted, len(wanted.broken), len(spared)):
            return f"{min(spared)} must break, and must not; leave one of the two out"

    if isinstance(limit, Untouched) and wanted.held:
        robot = not limit.by and not limit.max_force_n
        alone = {*wanted.bodies} & {*limit.untouched}
        if robot and _needs_some(wanted, len(wanted.bodies), len(alone)):
            return (
                f"{min(alone)} must be held, and must not be touched by the robot; leave one of the two out, or give "
                "max_force_n"
            )

    if isinstance(limit, Kept):
        return _find_kept(wanted, limit, scene)

    return ""


def _find_kept(wanted: Reach, limit: Kept, scene: Scene) -> str:
    """Say which body is to get farther than it may move; empty: none is."""
    if wanted.ever and not limit.throughout:  # it may come back
        return ""

    start = scene.state()
    kept = [body for body in wanted.bodies if body in limit.keep]
    far = dict[str, float]()
    for body in kept:
        for part in wanted.parts:
            if not isinstance(part, _MOVED):
                continue

            way = max(
                float(measure.left(start)) for measure in part.measures(body, start)
            )
            if way > limit.kept_m:
                far[body] = way

    if not _needs_some(wanted, len(wanted.bodies), len(far)):
        return ""

    body = min(far)
    return (
        f"{body} must get {far[body]:.3g} m from where it starts, and is to be kept within {limit.kept_m:g} m of it; "
        "leave it out of keep, or give kept_m"
    )


def _needs_some(goal: Reach, things: int, forbidden: int) -> bool:
    """Report whether a goal needs one of the forbidden things: the others are not enough."""
    return forbidden > 0 and goal.count_enough(things) > things - forbidden

"""Find the body that a rollout turned on, and tell its way: what touched it last, how it flew, how near it came."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from core.geometry import Array
from core.goals import Reach
from core.scene import Scene, State, Trace
from core.solids.contacts import Contacts
from core.values.bearing import Flags
from core.values.margins import Margin
from core.values.observations import Crux, Offset, Point

PAUSE_S = 0.5
"""Touches that are less apart are one."""

NEAR_S = 0.1
"""What touched a body within this time of the last touch is named for it."""

_KINDS = ("tool", "arm", "body")  # of contacts: what is named first


def choose_body(
    left: Sequence[str],
    errors: Mapping[str, Offset],
    margins: Iterable[Margin],
    state: State,
    *,
    solved: bool,
) -> str | None:
    """Choose the body that is farthest off its place; where the task is solved, that with the least room.

    Args:
        left: the bodies of the goals that are not in place.
        errors: how far each body of a goal is off its place.
        margins: of the task, the least first.
        state: has the bodies that can move.
        solved: whether the task is.

    Returns:
        Its name; None: no body is off its place or near a limit.
    """
    named = [name for margin in margins for name in (margin.subject, margin.body)]
    narrow = [name for name in named if name in state.names]
    far = sorted(errors, key=lambda name: -_measure(errors[name]))
    strayed = [name for name in (*far, *left) if name in left]

    chosen = [*narrow, *far] if solved else [*strayed, *narrow, *far]
    return next((name for name in chosen if name in state.names), None)


def describe_crux(
    body: str, scene: Scene, film: Trace, contacts: Contacts, goals: Iterable[Reach]
) -> Crux:
    """Tell the way of a body.

    Args:
        body: that can move.
        scene: the layout.
        film: of the rollout.
        contacts: in it.
        goals: that say where bodies should be.
    """
    times = film.times
    places = film.states.position(body)
    speeds = np.gradient(places, times, axis=0)
    touch = _find_last_touch(film.support.linked(body), times)
    toucher = ""
    touched_s = None
    velocity = None

    if touch is not None:
        first, last = touch
        touched_s = (round(float(times[first]), 2), round(float(times[last]), 2))
        toucher = _name_toucher(body, scene, contacts, float(times[last]))
        if last + 2 < len(times):
            velocity = _point(places[last + 2] - places[last + 1], times[1] - times[0])

    gaps = _measure_gaps(body, places, film.states[0], goals)
    nearest = int(gaps.argmin()) if gaps.size else 0

    return Crux(
        body=body,
        begun=_point(places[0]),
        ended=_point(places[-1]),
        toucher=toucher,
        touched_s=touched_s,
        velocity=velocity,
        nearest_m=round(float(gaps[nearest]), 3) if gaps.size else None,
        nearest_s=round(float(times[nearest]), 2),
        speed=round(float(np.linalg.norm(speeds[-1])), 2),
    )


def choose_instants(crux: Crux | None, end_s: float, count: int) -> Array:
    """Choose instants at which places are told: around the last touch of a body, where there is one.

    Args:
        crux: of the rollout.
        end_s: the end of it.
        count: about how many.

    Returns:
        Seconds, from 0 to the end.
    """
    if crux is None or crux.touched_s is None:
        return np.linspace(0.0, end_s, count)

    first, last = crux.touched_s
    if end_s - last < PAUSE_S:  # it is touched until the end
        return np.unique([0.0, *np.linspace(first, end_s, count - 1)])

    within = np.linspace(first, last, count // 2)
    after = np.linspace(last, end_s, count - len(within))[1:]
    return np.unique([0.0, *within, *after])


def _find_last_touch(linked: Flags, times: Array) -> tuple[int, int] | None:
    """Find the samples at which the last touch began and ended; None: there is none."""
    touched = np.flatnonzero(linked)
    if not touched.size:
        return None

    first = touched[-1]
    for later, earlier in pairwise(touched[::-1].tolist()):
        if times[later] - times[earlier] > PAUSE_S:
            break
        first = earlier

    return int(first), int(touched[-1])


def _name_toucher(body: str, scene: Scene, contacts: Contacts, instant: float) -> str:
    """Name what touched a body at an instant: a part of the tool or of the arm before another body that can move."""
    near = np.abs(contacts.taken.times - instant) <= NEAR_S
    found = []
    for (kind, first, second), touched in contacts.touching.items():
        if not (touched & near).any() or body not in (first, second):
            continue

        other = second if first == body and kind == "body" else first
        if kind != "body" or not scene[other].fixed:
            found.append((_KINDS.index(kind), other))

    return min(found)[1] if found else ""


def _measure_gaps(
    body: str, places: Array, start: State, goals: Iterable[Reach]
) -> Array:
    """Measure how far a body is from where the nearest goal wants it, metres, (T,); (0,): no goal says where."""
    gaps = []
    for goal in goals:
        if body not in goal.subjects(start):
            continue

        wanted = goal.place_of(body, start)
        if wanted is not None and not np.isnan(wanted).all():
            gaps.append(np.sqrt(np.nansum((places - wanted) ** 2, axis=1)))

    if not gaps:
        return np.zeros(0)
    return min(gaps, key=lambda gap: float(gap[-1]))


def _measure(offset: Offset) -> float:
    return float(np.linalg.norm([axis or 0.0 for axis in offset]))


def _point(values: Array, divisor: float = 1.0) -> Point:
    x, y, z = (round(float(value), 3) + 0.0 for value in values / divisor)
    return x, y, z

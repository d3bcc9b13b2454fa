"""Draw a film strip of a rollout: the six instants at which something happens."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise

import numpy as np

from core.interfaces import Image, Observation, Recording
from core.scene import Camera
from core.simulation.pictures import label
from plugins.vlms.context.calibrated_views import move_closer

FRAMES = 6

SIZE = (480, 360)
"""Of a frame, pixels."""

APART_S = 0.15
"""Between two frames, at least."""

STIRRED_M = 0.003
"""A body that has gone so far has begun to move."""

ROOM_M = 0.08
"""Around the way of what moves."""

LIFTED_M = 0.02
"""A body that is so much higher than at first is lifted."""

Moment = tuple[float, str]
"""Seconds, and what happens then."""


def draw_strip(
    recording: Recording,
    draw: Callable[..., Image],
    seen: Observation | None = None,
) -> Image:
    """Draw six instants of a rollout in one picture (720, 1440, 3): top row first, left to right.

    The camera looks at what moves, so that 10 mm are some pixels. The instants are those at which something happens,
    from the start of the motion to the end of the rollout (`moments`); each has its time and what happens.

    Args:
        recording: of the rollout.
        draw: draws one of its samples, of `SIZE` (`core.simulation.pictures.Film.draw`).
        seen: what was observed of the rollout, if it was.

    Returns:
        Red, green and blue, 0..255.

    Raises:
        NoPicture: nothing here can draw.
    """
    aim = _look_at_moved(recording)
    frames = []
    for instant, what in moments(recording, seen):
        number = int(np.abs(recording.times - instant).argmin())
        text = f"{instant:.1f} s: {what}" if what else f"{instant:.1f} s"
        frames.append(label(draw(number, aim), text))

    return np.vstack([np.hstack(frames[:3]), np.hstack(frames[3:])])


def _look_at_moved(recording: Recording) -> Callable[[Camera], Camera] | None:
    """Return what moves a camera close to the way of all that moves; None: nothing does."""
    places = recording.states.positions[recording.times >= 0]
    moved = np.ptp(places, axis=0).max(axis=-1) > STIRRED_M
    if not moved.any():
        return None

    points = places[:, moved].reshape(-1, 3)
    low = points.min(axis=0) - ROOM_M
    return partial(move_closer, low=low, high=points.max(axis=0) + ROOM_M)


def moments(recording: Recording, seen: Observation | None = None) -> list[Moment]:
    """Choose `FRAMES` instants of a recording to show, seconds, each with what happens then, in the order of time.

    The first are the start and the end, then what ``seen`` names: the first touches, and when it went wrong; else the
    first motion of a body. Then come the highest points of bodies that are lifted. Instants
    less than `APART_S` apart count as one. At last, the longest gaps are halved.

    Args:
        recording: of the rollout, from before the motion on.
        seen: what was observed of the rollout, if it was.
    Returns:
        `FRAMES` of them.
    """
    # In the order of what is most worth a frame.
    happened = [(0.0, "start"), (float(recording.times[-1]), "end")]
    if seen is not None:
        happened += _list_observed(seen)

    happened += _list_motions(recording)

    # The first of those that are close to each other counts.
    chosen: list[Moment] = []
    for moment in happened:
        new = all(abs(moment[0] - other) >= APART_S for other, _ in chosen)
        if new and len(chosen) < FRAMES:
            chosen.append(moment)

    # What is left is spread over the longest gaps.
    while len(chosen) < FRAMES:
        chosen.sort()
        gaps = list(pairwise(chosen)) or [(chosen[0], chosen[0])]
        before, after = max(gaps, key=lambda gap: gap[1][0] - gap[0][0])
        chosen.append(((before[0] + after[0]) / 2, ""))

    return sorted(chosen)


def _list_observed(seen: Observation) -> list[Moment]:
    """List when it went wrong, the last touch of the body that it turned on, and the first touches of all.

    Args:
        seen: what was observed of the rollout.

    Returns:
        What matters most goes first; instants may be close to each other.
    """
    touches: dict[str, Moment] = {}  # the first of each body
    for contact in sorted(seen.contacts, key=lambda contact: contact.first_s):
        if contact.kind != "body":
            text = f"{contact.one} touches {contact.other}"
            touches.setdefault(contact.other, (contact.first_s, text))

    observed = []
    if seen.at_s:
        text = f"{seen.result}: {seen.what}" if seen.what else seen.result
        observed.append((seen.at_s, text))

    crux = seen.crux
    if crux is not None and crux.touched_s is not None:
        first, last = crux.touched_s
        toucher = crux.toucher or "the robot"
        observed.append((first, f"{toucher} at {crux.body}"))
        if crux.velocity is not None:
            observed.append((last, f"{crux.body} leaves {toucher}"))

    return [*observed, *touches.values()]


def _list_motions(recording: Recording) -> Iterator[Moment]:
    """Yield when the two bodies that get farthest begin to move, and are highest.

    Args:
        recording: whose samples before 0 s, while bodies settle, don't count.
    Yields:
        Of each body at most two, in this order.
    """
    states = recording.states
    times = recording.times
    moving = times >= 0
    if not moving.any():
        return

    paths = states.positions - states.positions[moving][0]
    paths[~moving] = 0.0

    shifts = np.linalg.norm(paths, axis=-1)
    farthest = np.argsort(-shifts.max(axis=0), kind="stable")

    for body in farthest[:2].tolist():
        name = states.names[body]
        shift = shifts[:, body]
        height = paths[:, body, 2]
        if shift.max() <= STIRRED_M:
            continue

        yield float(times[np.argmax(shift > STIRRED_M)]), f"{name} moves"
        if height.max() > LIFTED_M:
            yield float(times[height.argmax()]), f"{name} is highest"

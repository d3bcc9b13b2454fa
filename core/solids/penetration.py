"""Find what the engine let happen and the real world would not: solids that pass through each other, bodies flung away.

Only recordings are read, so engines need not know of it. Two solids are followed by conservative advancement (B.
Mirtich, "Impulse-based dynamic simulation of rigid body systems", PhD thesis, Berkeley 1996, section 2.3): between
samples poses are interpolated, and an instant is skipped if the solids can't have got deeper than the limit by then.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from core.design import Tool
from core.geometry import Array
from core.interfaces import Recording, Robot
from core.scene import Scene
from core.solids.bodies import ROBOT
from core.solids.near_pairs import may_meet, neighbours
from core.solids.passage import DEEP_S, Depths, find_passage, relative_ways
from core.solids.record_rate import (
    coarse_samples,
    detours,
    is_finite,
    refined_samples,
    subset,
)
from core.solids.tracks import SAMPLE_HZ, Indices, Tracks, follow, lengths

FLUNG_M_S = 5.0  # a body was flung if it is faster than this, and
FLUNG_TIMES = 2.2  # so many times as fast as the robot ever was: an elastic blow gives twice the speed; and a tenth
LOST_M = 5.0  # from the arm's base
EXPLODED_M_S = 100.0
OVERRUN = {
    "hinge": 0.1,
    "slider": 0.003,
}  # rad and m that a tool's joint may go beyond its range, as stops are soft

_STILL_M = 1e-4  # a pair is looked at again when one of them has moved so far
_GRAVITY = 9.81


@dataclass(frozen=True)
class Finding:
    """Something unphysical, described in words. With ``penetration`` a reward that came of it means nothing."""

    text: str
    penetration: bool


class Explosion(Exception):
    """The simulation diverged; the message says how."""


def findings(
    scene: Scene, robot: Robot, tool: Tool, recording: Recording
) -> list[Finding]:
    """Find what is unphysical in a rollout of ``tool`` in ``scene``.

    There is one finding for each two things that passed through each other, at the first time, one for each joint of
    the tool that went beyond its range, and one for each body that was flung. The robot's own parts are not compared
    with each other, nor solids that overlap from the start.

    Raises:
        Explosion: a body's state is not finite, or it is faster than `EXPLODED_M_S` without a fall to explain it.
    """
    if not is_finite(recording):
        raise Explosion("a body's state is not finite")
    samples, unpressed = coarse_samples(recording), replace(recording, forces={})
    coarse = subset(unpressed, samples)
    tracks, times = (
        follow(scene, robot, tool, coarse, detours(recording, samples)),
        coarse.times,
    )
    flung, pairs = _flung(coarse, tracks), neighbours(tracks, joined=scene.joined)
    meetings = _meet(
        tracks, pairs, Depths.of(tracks.solids, pairs), _moving(tracks, pairs)
    )
    wanted = _wanted(meetings)
    if (wanted > 1).any() and len(samples) < len(recording.times):
        more = refined_samples(samples, wanted)  # elsewhere no two move near each other
        closer, before = (
            subset(unpressed, more),
            np.searchsorted(samples, more[:-1], side="right") - 1,
        )
        tracks, times = (
            follow(scene, robot, tool, closer, only=meetings.pairs),
            closer.times,
        )
        meetings = _meet(
            tracks, meetings.pairs, meetings.depths, meetings.near[:, before]
        )
    return [*_passages(meetings, times), *flung, *_overrun(tool, recording)]


def _overrun(tool: Tool, recording: Recording) -> Iterator[Finding]:
    """Find joints of the tool that stay beyond their range: a light part may be pressed through an engine's stop."""
    states = recording.fingers[:, recording.fingers.shape[1] - len(tool.bearers) :]
    for bearer, values in zip(tool.bearers, states.T, strict=True):
        joint = bearer.joint
        beyond = np.maximum(joint.lower - values, values - joint.upper)
        over = (beyond > OVERRUN[joint.kind])[1:]
        if np.diff(recording.times)[over].sum() > DEEP_S:
            first, unit = (
                recording.times[1:][over.argmax()],
                "rad" if joint.kind == "hinge" else "m",
            )
            text = f"{bearer.name!r} went {beyond.max():.3g} {unit} beyond the range of its joint from {first:.2f} s on"
            yield Finding(text, penetration=True)


class _Meetings(NamedTuple):
    """P pairs of solids (P, 2) that may get as deep in each other as counts; at least one of each is in motion.

    They may in the intervals ``near`` (P, T - 1).
    """

    tracks: Tracks
    pairs: Indices
    depths: Depths
    near: npt.NDArray[np.bool_]


def _meet(
    tracks: Tracks, pairs: Indices, depths: Depths, within: npt.NDArray[np.bool_]
) -> _Meetings:
    near = may_meet(tracks, pairs, depths.least, within)
    met = near.any(axis=1)
    return _Meetings(
        tracks, pairs[met], Depths(*(values[met] for values in depths)), near[met]
    )


def _moving(tracks: Tracks, pairs: Indices) -> npt.NDArray[np.bool_]:
    """Mark the intervals (P, T - 1) in which a pair may have moved since the last marked one; the first is marked."""
    rows = tracks.rows
    moved, turned, aside = (
        tracks.by_sample(values)[:, :-1]
        for values in (rows.moved, rows.turned, rows.aside)
    )
    travel = np.zeros((len(moved), tracks.samples))
    np.cumsum(
        moved + tracks.solids.reaches[tracks.moving, None] * turned,
        axis=1,
        out=travel[:, 1:],
    )
    marks, moves = (
        np.floor(travel / _STILL_M),
        np.zeros((len(tracks), tracks.samples - 1), dtype=bool),
    )
    moves[tracks.moving] = (marks[:, 1:] > marks[:, :-1]) | (aside > _STILL_M / 2)
    marked: npt.NDArray[np.bool_] = moves[pairs[:, 0]] | moves[pairs[:, 1]]
    marked[:, :1] = True
    return marked


def _wanted(meetings: _Meetings) -> Array:
    """How often to look in each interval (T - 1,): once each time that solids move as far as they are thick.

    It is 0 where none are near each other, nor were shortly before.
    """
    tracks, aside = meetings.tracks, meetings.tracks.rows.aside
    pair, interval = np.nonzero(meetings.near)
    one, other = meetings.pairs[pair].T
    away = aside[tracks.row(one, interval)] + aside[tracks.row(other, interval)]
    ways = relative_ways(tracks, one, other, interval) + 2 * away  # there and back
    wanted = np.zeros(tracks.samples - 1)
    np.maximum.at(wanted, interval, np.maximum(ways / meetings.depths.thick[pair], 1.0))
    for _ in range(
        math.ceil(DEEP_S * SAMPLE_HZ)
    ):  # what comes to rest is near no more, but may stay too deep
        wanted[1:] = np.maximum(wanted[1:], wanted[:-1] > 0)
    return wanted


def _passages(meetings: _Meetings, times: Array) -> list[Finding]:
    passages: dict[tuple[str, str], tuple[float, str]] = {}
    tracks, depths = meetings.tracks, np.array(meetings.depths).T.tolist()
    for i in np.flatnonzero(meetings.near.any(axis=1)).tolist():
        one, other = meetings.pairs[i].tolist()
        passage = find_passage(
            tracks, one, other, np.flatnonzero(meetings.near[i]), depths[i], times
        )
        if passage is not None:
            names = tracks[one].name, tracks[other].name
            passages[names] = min(passages.get(names, passage), passage)
    return [
        Finding(f"{one!r} {what.format(repr(other))}", True)
        for (one, other), (_, what) in passages.items()
    ]


def _flung(recording: Recording, tracks: Tracks) -> list[Finding]:
    """Find bodies faster than the robot and a fall can have made them, and bodies that are far away.

    Raises:
        Explosion: one is faster than `EXPLODED_M_S`.
    """
    states, flung = recording.states, []
    fallen = np.maximum(states.positions[:1, :, 2] - states.positions[:, :, 2], 0.0)
    squares = (states.linear_velocities**2).sum(axis=2) - 2 * _GRAVITY * fallen
    fastest = np.sqrt(np.maximum(squares, 0.0).max(axis=0))
    farthest = lengths(states.positions[:, :, :2]).max(axis=0)
    for name, speed, far in zip(states.names, fastest, farthest, strict=True):
        if speed > EXPLODED_M_S:
            raise Explosion(f"{name!r} reached {speed:.0f} m/s")
        if speed > FLUNG_M_S and speed > FLUNG_TIMES * (
            robot_speed := _top_speed(tracks, recording.times)
        ):
            flung.append(
                Finding(
                    f"{name!r} was flung: it reached {speed:.1f} m/s, the robot {robot_speed:.1f} m/s",
                    False,
                )
            )
        elif far > LOST_M:
            flung.append(Finding(f"{name!r} was flung: it got {far:.1f} m away", False))
    return flung


def _top_speed(tracks: Tracks, times: Array) -> float:
    """Bound the speed of any point of the robot, m/s, averaged over a tenth of a second."""
    if len(times) < 2:
        return 0.0
    count = max(1, min(len(times) - 1, round(0.1 * SAMPLE_HZ)))
    ways = [
        track.travel[count:] - track.travel[:-count]
        for track in tracks
        if track.owner == ROBOT
    ]
    return max(
        (float((way / (times[count:] - times[:-count])).max()) for way in ways),
        default=0.0,
    )

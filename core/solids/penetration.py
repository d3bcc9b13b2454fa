"""Find what the engine let happen and the real world would not: solids that pass through each other, bodies flung away.

Only recordings are read, so engines need not know of it. Two solids are followed by conservative advancement (B.
Mirtich, "Impulse-based dynamic simulation of rigid body systems", PhD thesis, Berkeley 1996, section 2.3): between
samples poses are interpolated, and an instant is skipped if the solids can't have got deeper than the limit by then.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import coal
import numpy as np
import numpy.typing as npt

from core.design import Tool
from core.geometry import Array
from core.interfaces import Recording, Robot
from core.scene import Scene
from core.solids.bodies import ROBOT, all_solids, body_solids
from core.solids.entry_side import Depths, Side
from core.solids.gap_bounds import SMOOTH, gap_bounds, may_meet, may_meet_closely, neighbours, with_next
from core.solids.record_rate import coarse_samples, detours, is_finite, joined, refined_samples, subset
from core.solids.tracks import SAMPLE_HZ, Detour, Indices, Track, Tracks, angles, follow, lengths

DEEP_S = 0.06  # a hard blow may penetrate deeper, for this long

FLUNG_M_S = 5.0  # a body was flung if it is faster than this, and
FLUNG_TIMES = 2.2  # so many times as fast as the robot ever was: an elastic blow gives twice the speed; and a tenth
LOST_M = 5.0  # from the arm's base
EXPLODED_M_S = 100.0

_FROM_AFAR_M = 0.02  # from this distance on, the first query finds the two apart: the side they came from is known
_STILL_M = 1e-4  # a pair is looked at again when one of them has moved so far
_AT_ONCE = 12_000  # samples of solids: their arrays stay in the processor's cache
_FEW = 24  # samples that are queried as fast as they are compared along an axis
_COAL_M = 1e-6  # depths that differ by less are equal: the tolerance of Coal's iterations
_REQUEST = coal.DistanceRequest()
_GRAVITY = 9.81


@dataclass(frozen=True)
class Finding:
    """Something unphysical, described in words. With ``penetration`` a reward that came of it means nothing."""

    text: str
    penetration: bool


class Explosion(Exception):
    """The simulation diverged; the message says how."""


def findings(scene: Scene, robot: Robot, tool: Tool, recording: Recording) -> list[Finding]:
    """Find what is unphysical in a rollout of ``tool`` in ``scene``.

    There is one finding for each two things that passed through each other, at the first time, and one for each body
    that was flung. The robot's own parts are not compared with each other, nor solids that overlap from the start.

    Raises:
        Explosion: a body's state is not finite, or it is faster than `EXPLODED_M_S` without a fall to explain it.
    """
    (found,) = findings_of_each(scene, robot, tool, [recording])
    if isinstance(found, Explosion):
        raise found
    return found


def findings_of_each(
    scene: Scene, robot: Robot, tool: Tool, recordings: Sequence[Recording]
) -> list[list[Finding] | Explosion]:
    """Find what is unphysical in each rollout of one tool, as `findings`.

    Short ones are looked at together: what numpy does with their samples takes less time than its calls.
    """
    found: list[list[Finding] | Explosion] = [Explosion("a body's state is not finite")] * len(recordings)
    finite = [i for i, recording in enumerate(recordings) if is_finite(recording)]
    moving = len(all_solids(robot, tool, body_solids(scene)).moving)
    parts = np.cumsum([moving * len(coarse_samples(recordings[i])) for i in finite]) // _AT_ONCE
    for part in np.unique(parts):
        some = [i for i, number in zip(finite, parts, strict=True) if number == part]
        for i, each in zip(some, _found(scene, robot, tool, [recordings[i] for i in some]), strict=True):
            found[i] = each
    return found


def _found(
    scene: Scene, robot: Robot, tool: Tool, recordings: Sequence[Recording]
) -> Iterator[list[Finding] | Explosion]:
    """Look at recordings as if they were one. Between two of them there is an interval that is never looked at."""
    recording, begins = joined(recordings), np.cumsum([0, *(len(each.times) for each in recordings)])
    each_ones = [coarse_samples(each) for each in recordings]
    samples = np.concatenate([at + begin for at, begin in zip(each_ones, begins[:-1], strict=True)])
    aside = zip(*(detours(each, at) for each, at in zip(recordings, each_ones, strict=True)), strict=True)
    coarse = subset(recording, samples)
    tracks = follow(scene, robot, tool, coarse, Detour(*map(np.hstack, aside)))
    parts = np.searchsorted(samples, begins)
    flung = [_flung(subset(coarse, np.arange(*part)), tracks.part(*part)) for part in pairwise(parts)]
    pairs = neighbours(tracks, joined=scene.joined)
    meetings = _meet(tracks, pairs, Depths.of(tracks.solids, pairs), _moving(tracks, pairs, parts))
    times, wanted = coarse.times, _wanted(meetings)
    if (wanted > 1).any() and len(samples) < len(recording.times):
        more = refined_samples(samples, wanted)  # elsewhere no two move near each other
        closer, before = subset(recording, more), np.searchsorted(samples, more[:-1], side="right") - 1
        tracks, times = follow(scene, robot, tool, closer, only=meetings.pairs), closer.times
        parts = np.searchsorted(more, begins)
        meetings = _meet(tracks, meetings.pairs, meetings.depths, meetings.near[:, before])
    for (begin, end), thrown in zip(pairwise(parts.tolist()), flung, strict=True):
        part = meetings._replace(tracks=tracks.part(begin, end), near=meetings.near[:, begin : max(begin, end - 1)])
        yield thrown if isinstance(thrown, Explosion) else _passages(part, times[begin:end]) + thrown


# --- penetration ------------------------------------------------------------------------------------------------


class _Meetings(NamedTuple):
    """P pairs of solids (P, 2) that may get as deep in each other as counts; at least one of each is in motion.

    They may in the intervals ``near`` (P, T - 1).
    """

    tracks: Tracks
    pairs: Indices
    depths: Depths
    near: npt.NDArray[np.bool_]


def _meet(tracks: Tracks, pairs: Indices, depths: Depths, within: npt.NDArray[np.bool_]) -> _Meetings:
    near = may_meet(tracks, pairs, depths.least, within)
    met = near.any(axis=1)
    return _Meetings(tracks, pairs[met], Depths(*(values[met] for values in depths)), near[met])


def _moving(tracks: Tracks, pairs: Indices, parts: Indices) -> npt.NDArray[np.bool_]:
    """Mark the intervals (P, T - 1) in which a pair may have moved since the last marked one.

    In each rollout, from one of ``parts`` (R + 1,) to the next, the first is marked; those between them are not.
    """
    rows, begins = tracks.rows, parts[:-1]
    moved, turned, aside = (tracks.by_sample(values)[:, :-1] for values in (rows.moved, rows.turned, rows.aside))
    travel = np.zeros((len(moved), tracks.samples))
    np.cumsum(moved + tracks.solids.reaches[tracks.moving, None] * turned, axis=1, out=travel[:, 1:])
    travel -= np.repeat(travel[:, begins], np.diff(parts), axis=1)
    marks, moves = np.floor(travel / _STILL_M), np.zeros((len(tracks), tracks.samples - 1), dtype=bool)
    moves[tracks.moving] = (marks[:, 1:] > marks[:, :-1]) | (aside > _STILL_M / 2)
    marked: npt.NDArray[np.bool_] = moves[pairs[:, 0]] | moves[pairs[:, 1]]
    marked[:, begins[begins < tracks.samples - 1]] = True
    marked[:, parts[1:-1] - 1] = False
    return marked


def _wanted(meetings: _Meetings) -> Array:
    """How often to look in each interval (T - 1,): once each time that solids move as far as they are thick.

    It is 0 where none are near each other, nor were shortly before.
    """
    tracks, aside = meetings.tracks, meetings.tracks.rows.aside
    pair, at = np.nonzero(meetings.near)
    one, other = meetings.pairs[pair].T
    away = aside[tracks.row(one, at)] + aside[tracks.row(other, at)]
    ways = _ways(tracks, one, other, at) + 2 * away  # there and back
    wanted = np.zeros(tracks.samples - 1)
    np.maximum.at(wanted, at, np.maximum(ways / meetings.depths.thick[pair], 1.0))
    for _ in range(math.ceil(DEEP_S * SAMPLE_HZ)):  # what comes to rest is near no more, but may stay too deep
        wanted[1:] = np.maximum(wanted[1:], wanted[:-1] > 0)
    return wanted


def _passages(meetings: _Meetings, times: Array) -> list[Finding]:
    found: dict[tuple[str, str], tuple[float, str]] = {}
    tracks, depths = meetings.tracks, np.array(meetings.depths).T.tolist()
    for i in np.flatnonzero(meetings.near.any(axis=1)).tolist():
        one, other = meetings.pairs[i].tolist()
        passage = _passage(tracks, one, other, np.flatnonzero(meetings.near[i]), depths[i], times)
        if passage is not None:
            names = tracks[one].name, tracks[other].name
            found[names] = min(found.get(names, passage), passage)
    return [Finding(f"{one!r} {what.format(repr(other))}", True) for (one, other), (_, what) in found.items()]


def _ways(tracks: Tracks, one: Indices | int, other: Indices | int, near: Indices) -> Array:
    """How far any point of a solid moves in the frame of another from samples ``near`` to the next, metres, (N,)."""
    rows, reach = tracks.rows, tracks.solids.reaches[one]
    at, others_at = tracks.row(one, near), tracks.row(other, near)
    if not np.any(tracks.moves[other]):
        return rows.moved[at] + reach * rows.turned[at]
    after, others_after = at + tracks.moves[one], others_at + tracks.moves[other]
    apart, apart_after = (rows.positions[i] - rows.positions[j] for i, j in ((at, others_at), (after, others_after)))
    back, back_after = (rows.rotations[j].swapaxes(1, 2) for j in (others_at, others_after))
    shift = np.einsum("nij,nj->ni", back_after, apart_after) - np.einsum("nij,nj->ni", back, apart)
    return lengths(shift) + reach * angles(back @ rows.rotations[at], back_after @ rows.rotations[after])


def _travel(tracks: Tracks, number: int, others_number: int, near: Indices) -> Array:
    """How far the first has moved in the frame of the second (see `Track.travel`): (T,).

    Where they can't be ``near`` each other it is an upper bound.
    """
    one, other = tracks[number], tracks[others_number]
    if len(other.positions) == 1:
        return one.travel
    steps = one.moved + one.reach * one.turned + other.moved
    steps += (lengths(one.positions - other.positions) + one.moved + other.moved + one.reach) * other.turned
    steps[near] = _ways(tracks, number, others_number, near)
    return np.concatenate([[0.0], np.cumsum(steps[:-1])])


def _passage(
    tracks: Tracks, number: int, others_number: int, near: Indices, depths: Sequence[float], times: Array
) -> tuple[float, str] | None:
    """The time when one got into the other, seconds, and a description; None if it never did."""
    one, other = tracks[number], tracks[others_number]
    thick, deep, through, touching, far_in = depths
    limit = min(deep, through)
    least = min(limit, touching)
    step = max(min(limit / 4, far_in), min(limit, thick) / 2)
    distance = coal.ComputeDistance(other.geometry, one.geometry)
    deep_ones = _deep(distance, tracks, number, others_number, near, least)
    if not len(deep_ones):
        return None
    travel = _travel(tracks, number, others_number, near)
    samples, gone, instants = deep_ones.tolist(), travel.tolist(), times.tolist()  # faster one by one
    intervals = set(samples)
    last = len(gone) - 1
    # The direction out of ``other`` when they last only touched, if ever; before that nothing counts.
    entry: Array | None = None
    side: Side | None = None  # the same, and since then it may have turned gradually
    reached = 0.0  # the largest depth since then
    found: tuple[float, str] | None = None
    since, stuck = 0.0, None  # when it got in, and since when it is too deep
    k, share = samples[0], 0.0
    while True:
        depth, out, rotation, others_rotation = _query(distance, one, other, k, share)
        now = instants[k] + (share * (instants[k + 1] - instants[k]) if share else 0.0)
        if depth < touching or (side is not None and side.same(out, rotation, others_rotation)):
            side = Side(out, rotation, others_rotation)
        elif found is None and side is not None and side.overlap(one, other, k, share) > depth + far_in:
            found = now, f"cut into {{}} at {now:.2f} s"  # it may come out on the other side
        if depth < (limit if entry is None else least):
            if entry is not None and reached >= through and out @ others_rotation @ entry < 0.5:
                return since, f"passed through {{}} at {since:.2f} s"
            entry, reached = out @ others_rotation, 0.0
        if depth >= limit and entry is not None:
            since = now if reached < limit else since
            reached = max(reached, depth)
        if depth < deep:
            stuck = None
        elif share == 0 and entry is not None:
            stuck = now if stuck is None else stuck
            if now - stuck >= DEEP_S:
                return stuck, f"was {1000 * reached:.0f} mm deep inside {{}} at {stuck:.2f} s"
        ahead = gone[k] + (share * (gone[k + 1] - gone[k]) if share else 0.0)
        if depth >= least:
            if k == last:
                return found
            ahead = min(ahead + step, gone[k + 1]) if k in intervals else gone[k + 1]
            k, share = (k + 1, 0.0) if ahead >= gone[k + 1] else (k, share)
            if ahead == gone[k]:
                continue
        else:
            ahead += max(least - depth, step) if -depth < _FROM_AFAR_M else -depth
            if ahead > gone[last]:
                return found
            at = bisect_left(samples, bisect_right(gone, ahead) - 1)
            if at == len(samples):
                return found
            if samples[at] > k:
                k, share = samples[at], 0.0
                continue
        share = (ahead - gone[k]) / (gone[k + 1] - gone[k])


def _deep(distance: Any, tracks: Tracks, number: int, others_number: int, near: Indices, least: float) -> Indices:
    """Those of the samples ``near`` from which on, until the next, two solids may get as deep as ``least``.

    From one sample to the next, a gap can't shrink and grow again by more than the way between.
    """
    one, other = tracks[number], tracks[others_number]
    least -= _COAL_M
    if isinstance(one.shape, SMOOTH) and isinstance(other.shape, SMOOTH):
        at, begin = with_next(near)
        gaps = gap_bounds(one, other, at)
        near = near[(gaps[begin] + gaps[begin + 1] - _ways(tracks, number, others_number, near)) / 2 <= -least]
    while len(near) > _FEW:  # what slides or rests is apart along the way out at one sample, at many others too
        _, out, rotation, others_rotation = _query(distance, one, other, int(near[0]), 0.0)
        rest = may_meet_closely(one, other, near, least, (out @ rotation, out @ others_rotation))
        if len(near) - len(rest) < _FEW:
            break
        near = rest
    return may_meet_closely(one, other, near, least) if len(near) else near


def _query(distance: Any, one: Track, other: Track, k: int, share: float) -> tuple[float, Array, Array, Array]:
    """The penetration depth, metres, negative if the two are apart; the way out for ``one``, (3,); and both rotations.

    ``distance`` is Coal's, from ``other`` to ``one``.
    """
    at, rotation = one.at(k, share)
    others_at, others_rotation = other.at(k, share)
    result = coal.DistanceResult()
    depth = -float(distance(others_at, at, _REQUEST, result))
    return depth, result.normal, rotation, others_rotation


# --- flung ------------------------------------------------------------------------------------------------------


def _flung(recording: Recording, tracks: Tracks) -> list[Finding] | Explosion:
    """Find bodies faster than the robot and a fall can have made them, and bodies that are far away.

    It is an explosion if one is faster than `EXPLODED_M_S`.
    """
    states, found = recording.states, []
    fallen = np.maximum(states.positions[:1, :, 2] - states.positions[:, :, 2], 0.0)
    squares = (states.linear_velocities**2).sum(axis=2) - 2 * _GRAVITY * fallen
    fastest = np.sqrt(np.maximum(squares, 0.0).max(axis=0))
    farthest = lengths(states.positions[:, :, :2]).max(axis=0)
    for name, speed, far in zip(states.names, fastest, farthest, strict=True):
        if speed > EXPLODED_M_S:
            return Explosion(f"{name!r} reached {speed:.0f} m/s")
        if speed > FLUNG_M_S and speed > FLUNG_TIMES * (robot_speed := _top_speed(tracks, recording.times)):
            found.append(
                Finding(f"{name!r} was flung: it reached {speed:.1f} m/s, the robot {robot_speed:.1f} m/s", False)
            )
        elif far > LOST_M:
            found.append(Finding(f"{name!r} was flung: it got {far:.1f} m away", False))
    return found


def _top_speed(tracks: Tracks, times: Array) -> float:
    """That of the robot, m/s."""
    return max((track.top_speed(times) for track in tracks if track.owner == ROBOT), default=0.0)

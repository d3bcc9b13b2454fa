"""Find what the engine let happen and the real world would not: solids that pass through each other, bodies flung away.

Only recordings are read, so engines need not know of it. Two solids are followed by conservative advancement (B.
Mirtich, "Impulse-based dynamic simulation of rigid body systems", PhD thesis, Berkeley 1996, section 2.3): between
samples poses are interpolated, and an instant is skipped if the solids can't have got deeper than the limit by then.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import coal
import numpy as np
import numpy.typing as npt

from core.design import Tool
from core.geometry import Array
from core.interfaces import Recording, Robot
from core.scene import Scene
from core.simulation.entry import Side, cut, skin, thickness
from core.simulation.gaps import gap_bounds, may_meet, may_meet_closely, neighbours, with_next
from core.simulation.sampling import Indices, coarse_samples, detours, is_finite, refined_samples, subset
from core.simulation.tracks import ROBOT, Track, angles, body_tracks, lengths, robot_tracks

DEEP_M = 0.01  # penetration allowed under pressure; at most half of what it takes to reach the other side
THIN_M = 0.003  # but for thin solids, pressed into a thick one too, as much as they are thick, and at least this much
DEEP_S = 0.06  # a hard blow may penetrate deeper, for this long
THROUGH = 2 / 3  # share of the way to the middle that counts as a passage if the solid leaves on the other side

FLUNG_M_S = 5.0  # a body was flung if it is faster than this, and
FLUNG_TIMES = 2.2  # so many times as fast as the robot ever was: an elastic blow gives twice the speed; and a tenth
LOST_M = 5.0  # from the arm's base
EXPLODED_M_S = 100.0

_FROM_AFAR_M = 0.02  # from this distance on, the first query finds the two apart: the side they came from is known
_STILL_M = 1e-4  # a pair is looked at again when one of them has moved so far
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
    if not is_finite(recording):
        raise Explosion("a body's state is not finite")
    samples = coarse_samples(recording)
    coarse = subset(recording, samples)
    dense = len(samples) < len(recording.times)
    around, aside = detours(recording, samples) if dense else (None, None)
    own, bodies = robot_tracks(robot, tool, coarse, around), body_tracks(scene, coarse, aside)
    pairs = neighbours(own, bodies, joined=scene.joined)
    meetings = _meetings(pairs, _moving(pairs)) if pairs and len(samples) > 1 else []
    times = coarse.times
    if meetings and dense:
        times, meetings = _closer(scene, robot, tool, recording, samples, own, bodies, meetings)
    top_speed = partial(_top_speed, own, coarse.times)
    return _passages(meetings, times) + _flung(coarse, top_speed)


def _closer(
    scene: Scene,
    robot: Robot,
    tool: Tool,
    recording: Recording,
    samples: Indices,
    own: Sequence[Track],
    bodies: Sequence[Track],
    meetings: Sequence[_Meeting],
) -> tuple[Array, list[_Meeting]]:
    """Look at meetings again, with more samples where solids move by more than they are thick; return their times."""
    wanted = np.ones(len(samples) - 1)
    for one, other, near in meetings:
        aside = one.aside[near] + (other.aside[near] if len(other.aside) > 1 else other.aside)
        ways = _ways(one, other, near) + 2 * aside  # there and back
        wanted[near] = np.maximum(wanted[near], ways / thickness(one, other))
    more = refined_samples(samples, wanted)
    closer = subset(recording, more)
    if len(more) == len(samples):
        return closer.times, list(meetings)
    met = {id(track) for meeting in meetings for track in meeting[:2]}
    at, others_at = ([i for i, track in enumerate(tracks) if id(track) in met] for tracks in (own, bodies))
    tracks = dict(zip((id(own[i]) for i in at), robot_tracks(robot, tool, closer, only=at), strict=True))
    others = body_tracks(scene, closer, only=others_at)
    tracks.update(zip((id(bodies[i]) for i in others_at), others, strict=True))
    within = np.zeros((len(meetings), len(samples)), dtype=bool)
    for i, meeting in enumerate(meetings):
        within[i, meeting.near] = True
    within = within[:, np.searchsorted(samples, more[:-1], side="right") - 1]
    return closer.times, _meetings([(tracks[id(one)], tracks[id(other)]) for one, other, *_ in meetings], within)


# --- penetration ------------------------------------------------------------------------------------------------


def _passages(meetings: Iterable[_Meeting], times: Array) -> list[Finding]:
    found: dict[tuple[str, str], tuple[float, str]] = {}
    for one, other, near in meetings:
        passage = _passage(one, other, near, times)
        if passage is not None:
            names = one.name, other.name
            found[names] = min(found.get(names, passage), passage)
    return [Finding(f"{one!r} {what.format(repr(other))}", True) for (one, other), (_, what) in found.items()]


class _Meeting(NamedTuple):
    """Two solids that may get as deep in each other as counts; at least one of them is in motion.

    ``near`` are the samples, rising, from which on they may, until the next.
    """

    one: Track
    other: Track
    near: Indices


def _meetings(pairs: Sequence[tuple[Track, Track]], within: npt.NDArray[np.bool_]) -> list[_Meeting]:
    if not within.any():
        return []
    kinds = [(one.half_width, other.half_width, one.owner == ROBOT) for one, other in pairs]
    depths = {kind: min(*_limits(*pair), skin(*pair)) for kind, pair in dict(zip(kinds, pairs, strict=True)).items()}
    least = np.array([depths[kind] for kind in kinds])
    kept = may_meet(pairs, least, within)
    return [_Meeting(*pairs[i], np.flatnonzero(kept[i])) for i in np.flatnonzero(kept.any(axis=1)).tolist()]


def _moving(pairs: Sequence[tuple[Track, Track]]) -> npt.NDArray[np.bool_]:
    """Mark the intervals (P, T - 1) in which a pair may have moved since the last marked one; the first is marked."""
    tracks = list({id(track): track for pair in pairs for track in pair}.values())
    number = {id(track): i for i, track in enumerate(tracks)}
    moving = [i for i, track in enumerate(tracks) if len(track.moved) > 1]
    moved, turned, aside = (
        np.array([getattr(tracks[i], name)[:-1] for i in moving]) for name in ("moved", "turned", "aside")
    )
    travel = np.zeros((len(moving), moved.shape[1] + 1))
    reaches = np.array([[tracks[i].reach] for i in moving])
    np.cumsum(moved + reaches * turned, axis=1, out=travel[:, 1:])
    moves = np.zeros((len(tracks), moved.shape[1]), dtype=bool)
    moves[moving] = (np.diff(travel // _STILL_M, axis=1) > 0) | (aside > _STILL_M / 2)
    one, other = np.array([[number[id(track)] for track in pair] for pair in pairs]).T
    marked: npt.NDArray[np.bool_] = moves[one] | moves[other]
    marked[:, 0] = True
    return marked


def _ways(one: Track, other: Track, near: Indices) -> Array:
    """How far any point of the first moves in the frame of the second from samples ``near`` to the next, (N,)."""
    if len(other.positions) == 1:
        return one.travel[near + 1] - one.travel[near]
    apart = one.positions - other.positions
    back, after = other.rotations[near].swapaxes(1, 2), other.rotations[near + 1].swapaxes(1, 2)
    shift = np.einsum("nij,nj->ni", after, apart[near + 1]) - np.einsum("nij,nj->ni", back, apart[near])
    turn = angles(back @ one.rotations[near], after @ one.rotations[near + 1])
    return lengths(shift) + one.reach * turn


def _travel(one: Track, other: Track, near: Indices) -> Array:
    """How far the first has moved in the frame of the second (see `Track.travel`): (T,).

    Where they can't be ``near`` each other it is an upper bound.
    """
    if len(other.positions) == 1:
        return one.travel
    steps = one.moved + one.reach * one.turned + other.moved
    steps += (lengths(one.positions - other.positions) + one.moved + other.moved + one.reach) * other.turned
    steps[near] = _ways(one, other, near)
    return np.concatenate([[0.0], np.cumsum(steps[:-1])])


def _limits(one: Track, other: Track) -> tuple[float, float]:
    """The depths, metres, from which two solids are too deep in each other, and may have passed through each other."""
    across = one.half_width + other.half_width
    pressed = min(across / 2, thickness(one, other))
    return min(DEEP_M, max(pressed, min(THIN_M, 0.9 * across))), THROUGH * across


def _passage(one: Track, other: Track, near: Indices, times: Array) -> tuple[float, str] | None:
    """The time when one got into the other, seconds, and a description; None if it never did."""
    deep, through = _limits(one, other)
    limit, touching = min(deep, through), skin(one, other)
    least, far_in = min(limit, touching), cut(one, other)
    step = max(min(limit / 4, far_in), min(limit, thickness(one, other)) / 2)
    distance = coal.ComputeDistance(other.geometry, one.geometry)
    deep_ones = _deep(distance, one, other, near, least)
    if not len(deep_ones):
        return None
    travel = _travel(one, other, near)
    samples, gone, instants = deep_ones.tolist(), travel.tolist(), times.tolist()  # faster one by one
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
            ahead = min(ahead + step, gone[k + 1])
            k, share = (k + 1, 0.0) if ahead >= gone[k + 1] else (k, share)
            if ahead == gone[k]:
                continue
        else:
            ahead += max(least - depth, step) if -depth < _FROM_AFAR_M else -depth
            if ahead > gone[last]:
                return found
            further = bisect_right(gone, ahead) - 1
            if further > k:
                k, share = further, 0.0
                if depth < least:
                    at = bisect_left(samples, k)
                    if at == len(samples):
                        return found
                    k = samples[at]
                continue
        share = (ahead - gone[k]) / (gone[k + 1] - gone[k])


def _deep(distance: Any, one: Track, other: Track, near: Indices, least: float) -> Indices:
    """Those of the samples ``near`` from which on, until the next, two solids may get as deep as ``least``.

    From one sample to the next, a gap can't shrink and grow again by more than the way between.
    """
    least -= _COAL_M
    at, begin = with_next(near)
    gaps = gap_bounds(one, other, at)
    if gaps is not None:
        near = near[(gaps[begin] + gaps[begin + 1] - _ways(one, other, near)) / 2 <= -least]
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


def _top_speed(robot: Sequence[Track], times: Array) -> float:
    return max((track.top_speed(times) for track in robot), default=0.0)


def _flung(recording: Recording, top_speed: Callable[[], float]) -> list[Finding]:
    """Find bodies faster than the robot and a fall can have made them, and bodies that are far away.

    Raises:
        Explosion: one is faster than `EXPLODED_M_S`.
    """
    states, found = recording.states, []
    fallen = np.maximum(states.positions[:1, :, 2] - states.positions[:, :, 2], 0.0)
    squares = (states.linear_velocities**2).sum(axis=2) - 2 * _GRAVITY * fallen
    fastest = np.sqrt(np.maximum(squares, 0.0).max(axis=0))
    farthest = np.linalg.norm(states.positions[:, :, :2], axis=2).max(axis=0)
    for name, speed, far in zip(states.names, fastest, farthest, strict=True):
        if speed > EXPLODED_M_S:
            raise Explosion(f"{name!r} reached {speed:.0f} m/s")
        if speed > FLUNG_M_S and speed > FLUNG_TIMES * (robot_speed := top_speed()):
            found.append(
                Finding(f"{name!r} was flung: it reached {speed:.1f} m/s, the robot {robot_speed:.1f} m/s", False)
            )
        elif far > LOST_M:
            found.append(Finding(f"{name!r} was flung: it got {far:.1f} m away", False))
    return found

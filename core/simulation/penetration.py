"""Find what the engine let happen and the real world would not: solids that pass through each other, bodies flung away.

Only recordings are read, so engines need not know of it. Two solids are followed by conservative advancement (B.
Mirtich, "Impulse-based dynamic simulation of rigid body systems", PhD thesis, Berkeley 1996, section 2.3): between
samples poses are interpolated, and an instant is skipped if the solids can't have got deeper than the limit by then.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import coal
import numpy as np
import numpy.typing as npt

from core.design import Tool
from core.geometry import Array, Box, Cylinder, Sphere
from core.interfaces import Recording
from core.scene import Scene
from core.simulation.tracks import Track, body_tracks, robot_tracks, travelled

DEEP_M = 0.01  # penetration allowed under pressure; at most half of what it takes to reach the other side
THIN_M = 0.003  # but for thin solids this much
DEEP_S = 0.06  # a hard blow may penetrate deeper, for this long
THROUGH = 2 / 3  # share of the way to the middle that counts as a passage if the solid leaves on the other side

FLUNG_M_S = 5.0  # a body was flung if it is faster than this, and
FLUNG_TIMES = 3.0  # so many times as fast as the robot ever was: an elastic blow gives at most twice the speed
LOST_M = 5.0  # from the arm's base
EXPLODED_M_S = 100.0

_FROM_AFAR_M = 0.02  # from this distance on, the first query finds the two apart: the side they came from is known
_REQUEST = coal.DistanceRequest()
_GRAVITY = 9.81


@dataclass(frozen=True)
class Finding:
    """Something unphysical, described in words. With ``penetration`` a reward that came of it means nothing."""

    text: str
    penetration: bool


class Explosion(Exception):
    """The simulation diverged; the message says how."""


def findings(scene: Scene, tool: Tool, recording: Recording) -> list[Finding]:
    """Find what is unphysical in a rollout of ``tool`` in ``scene``.

    There is one finding for each two things that passed through each other, at the first time, and one for each body
    that was flung. The robot's own parts are not compared with each other, nor solids that overlap from the start.

    Raises:
        Explosion: a body's state is not finite, or it is faster than `EXPLODED_M_S` without a fall to explain it.
    """
    states = recording.states
    for values in (states.positions, states.quaternions, states.linear_velocities, recording.arm):
        if not np.isfinite(values).all():
            raise Explosion("a body's state is not finite")
    robot = robot_tracks(tool, recording)
    flung = _flung(recording, max((track.top_speed(recording.times) for track in robot), default=0.0))
    return _passages(robot, body_tracks(scene, recording), recording.times) + flung


# --- penetration ------------------------------------------------------------------------------------------------


def _passages(robot: Sequence[Track], bodies: Sequence[Track], times: Array) -> list[Finding]:
    found: dict[tuple[str, str], tuple[float, str]] = {}
    for one, other, near, travel in _meetings(robot, bodies):
        passage = _passage(one, other, near, travel, times)
        if passage is not None:
            names = one.name, other.name
            found[names] = min(found.get(names, passage), passage)
    return [Finding(f"{one!r} {what.format(repr(other))}", True) for (one, other), (_, what) in found.items()]


def _meetings(
    robot: Sequence[Track], bodies: Sequence[Track]
) -> Iterator[tuple[Track, Track, npt.NDArray[np.intp], Array]]:
    """Yield pairs, at least one of them in motion, with bounding boxes that ever overlap by as much as counts.

    With each pair come the samples at which the boxes meet or are about to, rising, and the travel (T,) of the first in
    the frame of the second (see `Track.travel`).
    """
    moving = [track for track in (*robot, *bodies) if len(track.travel) > 1]
    if not moving:
        return
    low = np.array([track.low.T for track in moving]).swapaxes(0, 1).copy()  # (3, M, T)
    high = np.array([track.high.T for track in moving]).swapaxes(0, 1).copy()
    lowest, highest = low.min(axis=2), high.max(axis=2)
    reaches = np.array([track.reach for track in moving])
    order = {id(track): i for i, track in enumerate(moving)}
    for other in bodies:
        count = order.get(id(other), len(moving))  # of two bodies that move, each pair once
        below, above = other.low.min(axis=0)[:, None], other.high.max(axis=0)[:, None]
        if not ((lowest[:, :count] <= above) & (highest[:, :count] >= below)).all(axis=0).any():
            continue
        near = np.ones((count, low.shape[2]), dtype=bool)
        for axis in range(3):
            near &= low[axis, :count] <= other.high[:, axis]
            near &= high[axis, :count] >= other.low[:, axis]
        met = [i for i in np.flatnonzero(near.any(axis=1)) if moving[i].owner != other.owner]
        # Solids are no deeper in each other than their boxes along any axis.
        depths = np.minimum(high[:, met] - other.low.T[:, None], other.high.T[:, None] - low[:, met]).min(axis=0)
        deepest = depths.max(axis=1).tolist()
        met = [i for i, depth in zip(met, deepest, strict=True) if depth >= min(_limits(moving[i], other))]
        if not met:
            continue
        if len(other.travel) == 1:
            yield from ((moving[i], other, np.flatnonzero(near[i]), moving[i].travel) for i in met)
            continue
        positions = np.array([moving[i].positions for i in met]) - other.positions
        rotations = np.array([moving[i].rotations for i in met])
        if not isinstance(other.shape, Sphere):  # the frame of a ball does not turn
            back = other.rotations.swapaxes(1, 2)
            positions, rotations = (back @ positions[..., None])[..., 0], back @ rotations
        travels = travelled(rotations, positions, reaches[met])
        yield from ((moving[i], other, np.flatnonzero(near[i]), way) for i, way in zip(met, travels, strict=True))


def _limits(one: Track, other: Track) -> tuple[float, float]:
    """The depths, metres, from which two solids are too deep in each other, and may have passed through each other."""
    across = one.half_width + other.half_width
    return min(DEEP_M, max(across / 2, min(THIN_M, 0.9 * across))), THROUGH * across


def _passage(
    one: Track, other: Track, near: npt.NDArray[np.intp], travel: Array, times: Array
) -> tuple[float, str] | None:
    """The time when one got into the other, seconds, and a description; None if it never did."""
    deep, through = _limits(one, other)
    limit = min(deep, through)
    gaps = _gaps(one, other)
    # From one sample to the next, a gap can't shrink and grow again by more than the travel allows.
    if gaps is not None and (
        ((gaps[:-1] + gaps[1:] - travel[1:] + travel[:-1]) / 2).take(near, mode="clip").min() > -limit
    ):
        return None
    distance = coal.ComputeDistance(other.geometry, one.geometry)
    samples, gone, instants = near.tolist(), travel.tolist(), times.tolist()  # faster one by one
    last = len(gone) - 1
    # The direction out of ``other`` when the two last only touched, if ever; before that nothing counts.
    entry: _Exit | None = None
    reached = 0.0  # the largest depth since then
    since, stuck = 0.0, None  # when it got in, and since when it is too deep
    k, share = samples[0], 0.0
    while True:
        depth, out = _query(distance, one, other, k, share)
        if depth < (limit if entry is None else 0.0):
            if entry is not None and reached >= through and out.along(entry) < 0.5:
                return since, f"passed through {{}} at {since:.2f} s"
            entry, reached = out, 0.0
        if depth >= limit and entry is not None:
            now = instants[k] + (share * (instants[k + 1] - instants[k]) if share else 0.0)
            since = now if reached < limit else since
            reached = max(reached, depth)
        if depth < deep:
            stuck = None
        elif share == 0 and entry is not None:
            stuck = instants[k] if stuck is None else stuck
            if instants[k] - stuck >= DEEP_S:
                return stuck, f"was {1000 * reached:.0f} mm deep inside {{}} at {stuck:.2f} s"
        ahead = gone[k] + (share * (gone[k + 1] - gone[k]) if share else 0.0)
        if depth >= limit:
            if k == last:
                return None
            ahead = min(ahead + limit, gone[k + 1])
            k, share = (k + 1, 0.0) if ahead >= gone[k + 1] else (k, share)
            if ahead == gone[k]:
                continue
        else:
            ahead += max(limit - depth, limit / 4) if -depth < _FROM_AFAR_M else -depth
            if ahead > gone[last]:
                return None
            further = bisect_right(gone, ahead) - 1
            if further > k:
                k, share = further, 0.0
                if depth < 0:
                    at = bisect_left(samples, k)
                    if at == len(samples):
                        return None
                    k = samples[at]
                continue
        share = (ahead - gone[k]) / (gone[k + 1] - gone[k])


def _gaps(one: Track, other: Track) -> Array | None:
    """Distances (T,) between a ball and a ball, box or cylinder, metres, negative if they overlap; None for others."""
    ball, solid = (one, other) if isinstance(one.shape, Sphere) else (other, one)
    if not isinstance(ball.shape, Sphere):
        return None
    gaps: Array
    match solid.shape:
        case Sphere(radius):
            offsets = ball.positions - solid.positions
            gaps = np.sqrt(np.einsum("ti,ti->t", offsets, offsets)) - radius - ball.shape.radius
            return gaps
        case Box(size):
            beyond = np.abs(_inside(ball, solid)) - np.asarray(size) / 2
        case Cylinder(radius, length):
            x, y, z = _inside(ball, solid).T
            beyond = np.column_stack([np.hypot(x, y) - radius, np.abs(z) - length / 2])
        case _:
            return None
    outside = np.maximum(beyond, 0.0)
    gaps = np.sqrt((outside * outside).sum(axis=1)) + np.minimum(beyond.max(axis=1), 0.0) - ball.shape.radius
    return gaps


def _inside(one: Track, other: Track) -> Array:
    """Positions (T, 3) of one solid in the frame of the other."""
    return ((one.positions - other.positions)[:, None] @ other.rotations)[:, 0]


class _Exit(NamedTuple):
    """The shortest way out of a solid: a direction (3,) in the world, and the solid's rotation (3, 3)."""

    direction: Array
    rotation: Array

    def along(self, other: _Exit) -> float:
        """The cosine between two directions, each in the solid's own frame."""
        return float(self.direction @ self.rotation @ (other.direction @ other.rotation))


def _query(distance: Any, one: Track, other: Track, k: int, share: float) -> tuple[float, _Exit]:
    """The penetration depth, metres, negative if the two are apart; and the way out for ``one``.

    ``distance`` is Coal's, from ``other`` to ``one``.
    """
    at, _ = one.at(k, share)
    others_at, others_rotation = other.at(k, share)
    result = coal.DistanceResult()
    depth = -float(distance(others_at, at, _REQUEST, result))
    return depth, _Exit(result.normal, others_rotation)


# --- flung ------------------------------------------------------------------------------------------------------


def _flung(recording: Recording, robot_speed: float) -> list[Finding]:
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
        if speed > max(FLUNG_M_S, FLUNG_TIMES * robot_speed):
            found.append(
                Finding(f"{name!r} was flung: it reached {speed:.1f} m/s, the robot {robot_speed:.1f} m/s", False)
            )
        elif far > LOST_M:
            found.append(Finding(f"{name!r} was flung: it got {far:.1f} m away", False))
    return found

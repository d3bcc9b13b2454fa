"""Find which things touched in a rollout and when, and how near the robot came to the others.

Only recordings are read, so the notion is the same in every engine: two things are in contact while the gap between
their collision shapes is at most what engines leave between things that rest on each other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.interfaces import Recording, Robot
from core.robot.kinematics import link_frames
from core.scene import Scene, Trace
from core.solids.near_pairs import Flags, may_meet, neighbours
from core.solids.record_rate import coarse_samples, largest_since, subset
from core.solids.rollout_solids import ROBOT
from core.solids.tracks import Indices, Pair, Track, Tracks, follow, lengths
from core.values.grips import Gripped
from core.values.traces import TRACE_HZ

TOUCH_M = 0.0005  # the largest gap of a contact
HULL_M = 0.001  # so much more for each hull: PyBullet's margin
STRUCK_M_S = 0.3  # a body whose velocity changes by more than this between two samples was struck
STRUCK_M = 0.1  # by something that came within this distance, or nearer

Key = tuple[str, str, str]  # kind, one and other of a `Contact`


class Approach(NamedTuple):
    """How near the robot came to a body: the gap, metres, at which sample, and the part of the robot."""

    gap_m: float
    sample: int = 0
    part: str = ""


_TOUCHED = Approach(0.0)


@dataclass(frozen=True, eq=False)
class Contacts:
    """The contacts of a rollout, and how near the robot came to what it did not touch.

    Observations list them, and a reward reads them as a `Trace` (`make_trace`). A contact has a kind: a component
    of the tool touches a body, a link of the arm does, or another body. With fingers alone, the arm's are meant.

    Attributes:
        taken: the T samples of the recording that were looked at.
        touching: for each two things that ever touched, at which samples (T,).
        depths: the largest penetration of each two, metres.
        approaches: how near the robot came to each body that it never touched.
        touch_m: how far from its mount's origin the tool first touched a body that can move; None: it touched none.
        peaks: the largest force of each two things since the sample before, as often as there is a recording (T,), N.
    """

    taken: Recording
    touching: dict[Key, Flags]
    depths: dict[Key, float]
    approaches: dict[str, Approach]
    touch_m: float | None
    peaks: dict[tuple[str, str], Array]

    def with_robot(self, body: str) -> Flags:
        """Report when the arm or the tool touches a body.

        Args:
            body: its name.

        Returns:
            At which samples (T,).
        """
        touched = np.zeros(len(self.taken.times), dtype=bool)

        for (kind, _, second), flags in self.touching.items():
            if kind != "body" and second == body:
                touched |= flags

        return touched


class _Touch(NamedTuple):
    """Two solids that touch.

    Attributes:
        key: what they are called.
        pair: the two over time.
        touched: (T,) at which of the samples.
        depth: how deep they get in each other, metres.
    """

    key: Key
    pair: Pair
    touched: Flags
    depth: float


def find_contacts(
    scene: Scene,
    robot: Robot,
    tool: Tool,
    recording: Recording,
) -> Contacts:
    """Find the contacts of a rollout, at samples about `SAMPLE_HZ` apart.

    Args:
        scene: its bodies.
        robot: the arm.
        tool: what it holds.
        recording: of the rollout.
    """
    samples = coarse_samples(recording)
    taken = subset(recording, samples)
    peaks = {
        pair: largest_since(values, samples)
        for pair, values in recording.forces.items()
    }
    tracks = follow(scene, robot, tool, taken)
    touches = list(_find_touches(scene, tool, tracks, taken))

    touching: dict[Key, Flags] = {}
    depths: dict[Key, float] = {}

    for key, _, touched, depth in touches:
        touching[key] = touching.get(key, False) | touched
        depths[key] = max(depth, depths.get(key, depth))

    for key, touched in _find_soft_touches(scene, tool, taken):
        touching[key] = touched
        depths[key] = 0.0

    met = {other for kind, _, other in touching if kind != "body"}
    missed = {body.name for body in scene.bodies} - met
    robots = [track for track in tracks.items if track.owner == ROBOT]
    others = [track for track in tracks.items if track.owner in missed]

    by_tool = [
        touch
        for touch in touches
        if touch.key[0] == "tool" and not scene[touch.pair.second.owner].fixed
    ]
    return Contacts(
        taken,
        touching,
        depths,
        nearest(robots, others),
        _measure_first_touch(robot, tool, taken, by_tool),
        peaks,
    )


def _find_touches(
    scene: Scene,
    tool: Tool,
    tracks: Tracks,
    taken: Recording,
) -> Iterator[_Touch]:
    """Yield each pair of solids that touches.

    Args:
        scene: its bodies, some of which are joined.
        tool: tells its components from links.
        tracks: all solids at T samples.
        taken: the recording at these samples.
    """
    pairs = neighbours(tracks, TOUCH_M + 2 * HULL_M, scene.joined)
    solids = tracks.solids

    # Where they are near enough.
    shapes = [solid.shape for solid in solids.items]
    hulls = np.array([shape is None or shape.is_hull for shape in shapes])
    most = TOUCH_M + HULL_M * hulls[pairs].sum(axis=1)
    near = may_meet(tracks, pairs, -most)

    # Where one of them is struck, and the other may have come by.
    struck = _find_struck(taken)
    never = np.zeros(len(taken.times) - 1, dtype=bool)
    strikes = np.array([struck.get(solid.owner, never) for solid in solids.items])
    either = strikes[pairs[:, 0]] | strikes[pairs[:, 1]]
    hit = may_meet(tracks, pairs, np.full(len(pairs), -STRUCK_M), either)

    of_tool = {*tool.mounts, *tool.placed()}
    for number in np.flatnonzero((near | hit).any(axis=1)).tolist():
        pair = tracks.pair(pairs[number])
        touched, depth = _touch(pair, most[number], near[number], hit[number])
        if not touched.any():
            continue

        kind = "arm"
        if pair.first.owner != ROBOT:
            kind = "body"
        elif pair.first.name in of_tool:
            kind = "tool"

        key = (kind, pair.first.name, pair.second.name)
        yield _Touch(key, pair, touched, depth)


def _touch(
    pair: Pair,
    most: float,
    near: Flags,
    hit: Flags,
) -> tuple[Flags, float]:
    """Find out when two solids touch.

    Args:
        pair: the two.
        most: the largest gap of a contact, metres.
        near: (T - 1,) the intervals in which the gap may be as small.
        hit: (T - 1,) those in which one of them is struck, and that may be by the other. They touch at the end of such
            an interval if they may have met in it.

    Returns:
        At which samples (T,) they touch, and how deep they are in each other at most, metres.
    """
    looked = near | hit
    samples = np.flatnonzero(np.append(looked, False) | np.append(False, looked))
    gaps = np.full(len(near) + 1, np.inf)
    gaps[samples] = pair.gaps(samples)

    touched = gaps <= most
    met = gaps[:-1] + gaps[1:] - np.diff(pair.travel) <= 2 * most
    touched[1:] |= hit & met

    return touched, -float(gaps.min())


def _find_struck(recording: Recording) -> dict[str, Flags]:
    """Report when bodies were struck: their velocities change abruptly.

    Args:
        recording: how the free bodies move, at T samples.

    Returns:
        For each free body in which intervals (T - 1,).
    """
    states = recording.states
    changes = np.linalg.norm(np.diff(states.linear_velocities, axis=0), axis=2)
    limits = STRUCK_M_S + 9.81 * np.diff(recording.times)[:, None]  # it may fall

    return dict(zip(states.names, (changes > limits).T, strict=True))


def _find_soft_touches(
    scene: Scene, tool: Tool, taken: Recording
) -> Iterator[tuple[Key, Flags]]:
    """Yield what touches soft bodies, and at which of the samples (T,): engines alone know, by the force."""
    bodies = {body.name for body in scene.bodies}
    softs = {soft.name for soft in scene.softs}

    for (presser, body), force in taken.forces.items():
        if not softs & {presser, body}:
            continue

        kind = "arm"
        if presser in bodies:
            kind = "body"
        elif presser == "tool" and tool.components:
            kind = "tool"

        yield (kind, presser, body), force > 0


def _measure_first_touch(
    robot: Robot,
    tool: Tool,
    taken: Recording,
    touches: Sequence[_Touch],
) -> float | None:
    """Measure how far from its mount the tool first touched something.

    Args:
        robot: the arm.
        tool: what it holds.
        taken: how the arm moves.
        touches: those that count.

    Returns:
        The distance of the nearest point of the tool to the mount's origin, metres; None: there is no touch.
    """
    if not touches:
        return None

    first = min(touches, key=lambda touch: touch.touched.argmax())
    k = int(first.touched.argmax())
    name = first.pair.first.name
    mount, _ = tool.placed().get(name, (name, None))
    frames = link_frames(robot, tool, taken.arm[[k]], taken.fingers[[k]])
    _, positions = frames[mount]

    return float(lengths(first.pair.look(k).nearest - positions[0]))


def nearest(
    robot: Sequence[Track], bodies: Sequence[Track], most: int | None = 40
) -> dict[str, Approach]:
    """Find how near the robot came to each body.

    Args:
        robot: its solids.
        bodies: the solids of bodies.
        most: how often a body's solid is measured, where the boxes are nearest; None: as often as needed.
    """
    found: dict[str, Approach] = {}
    if not robot:
        return found

    middles = np.array([track.middles for track in robot])
    extents = np.array([_extents(track) for track in robot])

    for body in bodies:
        apart = np.abs(middles - body.middles) - extents - _extents(body)
        apart = np.maximum(apart, 0.0)
        bounds = np.sqrt((apart * apart).sum(axis=2))  # (robot, T)

        best = found.get(body.owner, Approach(np.inf))
        for _ in range(most or bounds.size):
            number, sample = divmod(int(bounds.argmin()), bounds.shape[1])
            if bounds[number, sample] >= best.gap_m:
                break

            gap = -Pair(robot[number], body).look(sample).depth
            best = min(best, Approach(gap, sample, robot[number].name))
            bounds[number, sample] = np.inf

        found[body.owner] = best

    return found


def _extents(track: Track) -> Array:
    """Measure the bounding boxes of a solid along the world's axes.

    Args:
        track: of the solid, at T samples.

    Returns:
        Half lengths (T, 3), metres.
    """
    return np.abs(track.rotations) @ track.box


def make_trace(
    scene: Scene, contacts: Contacts, gripped: Sequence[Gripped] = ()
) -> Trace:
    """Make the trace of a rollout.

    What the robot touched and pressed before its motion began counts at 0, and between two instants at the nearest. A
    body that it only touched between two samples of a recording is one that it pressed.

    Args:
        scene: that it began in.
        contacts: of the rollout.
        gripped: what the tool's grips did.
    """
    taken = contacts.taken
    count = math.ceil(taken.times[-1] * TRACE_HZ - 1e-6) + 1
    instants = np.arange(count) / TRACE_HZ
    clock = _Clock(taken.times, instants)
    bodies = {body.name for body in scene.bodies}
    forces: dict[tuple[str, str], Array] = {}
    peaks: dict[tuple[str, str], Array] = {}
    loads = {name: clock.read(load, early=True) for name, load in taken.loads.items()}
    touching = {
        key: clock.read(flags, early=key[0] != "body")
        for key, flags in contacts.touching.items()
    }

    for pair, values in taken.forces.items():
        presser, body = pair
        by_robot = presser not in bodies
        forces[pair] = clock.read(values, early=by_robot)
        peaks[pair] = clock.read(contacts.peaks[pair], early=by_robot)

        if by_robot and not contacts.with_robot(body).any():
            key = ("tool" if presser == "tool" else "arm", presser, body)
            touching[key] = touching.get(key, False) | (forces[pair] > 0)

    # An engine that measures no forces has none where things touch, and none on bonds.
    measured = bool(forces or loads) or not touching
    clearances = {
        name: np.asarray(contacts.approaches.get(name, _TOUCHED).gap_m)
        for name in bodies
    }
    trace = Trace(
        instants,
        scene.complete(taken.states.each(clock.choose)),
        touching,
        forces if measured else None,
        clearances,
        peaks if measured else None,
        gripped=_note_grips(gripped, instants),
    )
    if not measured:
        return trace

    strains = {}
    for name, most in scene.breakable.items():
        if name in bodies:
            strains[name] = trace.peaks_n(name) / most
        elif name in loads:
            strains[name] = loads[name] / most

    return replace(trace, strains=strains)


def _note_grips(
    gripped: Sequence[Gripped], instants: Array
) -> dict[tuple[str, str], Flags]:
    """Say at which instants (N,) which component held which body."""
    found: dict[tuple[str, str], Flags] = {}
    for entry in gripped:
        if entry.hardest is not None:
            key = (entry.component, entry.body)
            held = entry.holds(instants)
            found[key] = found.get(key, np.zeros_like(held)) | held

    return found


class _Clock:
    """Reads what a recording of T samples holds at the N instants of a trace.

    Attributes:
        chosen: (N,) the samples that are nearest to the instants.
    """

    def __init__(self, times: Array, instants: Array) -> None:
        self.chosen: Indices = np.searchsorted((times[1:] + times[:-1]) / 2, instants)
        self._skipped = np.setdiff1d(np.arange(len(times)), self.chosen)
        skipped = times[self._skipped]
        numbers = np.rint(skipped * TRACE_HZ).astype(int)
        self._nearest = np.clip(numbers, 0, len(instants) - 1)
        self._begun = skipped >= 0

    def choose(self, values: Array) -> Array:
        """Choose of values (T, ...) those at the instants (N, ...)."""
        return values[self.chosen]

    def read(self, values: Array | Flags, *, early: bool) -> Any:
        """Read at the instants (N,). Of samples between two instants the largest counts at the nearest one.

        Args:
            values: (T,) numbers or flags.
            early: whether those before the motion began count too.
        """
        read = values[self.chosen]
        counted = values[self._skipped] * (self._begun | early)
        np.maximum.at(read, self._nearest, counted)

        return read

"""Find which things touched in a rollout and when, and how near the robot came to the others.

Only recordings are read, so the notion is the same in every engine: two things are in contact while the gap between
their collision shapes is at most what engines leave between things that rest on each other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from core.design import Tool
from core.geometry import Array, Mesh
from core.interfaces import Contact, Recording, Robot
from core.robot.kinematics import link_frames
from core.scene import Scene, State, Trace
from core.solids.bodies import ROBOT
from core.solids.near_pairs import may_meet, neighbours
from core.solids.record_rate import coarse_samples, subset
from core.solids.tracks import Indices, Pair, Track, Tracks, follow, lengths
from core.values.states import TRACE_HZ

TOUCH_M, HULL_M = (
    0.0005,
    0.001,
)  # the largest gap of a contact; so much more for each hull: PyBullet's margin
STRUCK_M_S = 0.3  # a body whose velocity changes by more than this between two samples was struck
STRUCK_M = 0.1  # by something that came within this distance, or nearer

Key = tuple[str, str, str]  # kind, one and other of a `Contact`
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Contacts:
    """The contacts of a rollout, and the clearances.

    Attributes:
        touch_m: how far from its mount's origin the tool first touched a body that can move; None: it touched none.
    """

    taken: Recording  # the T samples of the recording that were looked at
    touching: dict[
        Key, Flags
    ]  # for each two things that ever touched, at which samples (T,)
    resting: frozenset[
        Key
    ]  # the bodies among them that touched before the motion began
    depths: dict[Key, float]  # the largest penetration of each two, metres
    clearances: dict[
        str, float
    ]  # the smallest gap between the robot and each body that it never touched, metres
    touch_m: float | None = None

    @cached_property
    def all(self) -> tuple[Contact, ...]:
        """The contacts, the earliest first, without those of bodies that touched before the motion began."""
        contacts, forces = [], self.taken.forces or None
        for key in self.touching.keys() - self.resting:
            first, last = self.taken.times[
                np.flatnonzero(self.touching[key])[[0, -1]]
            ].tolist()
            force = None if forces is None else float(self._force(key).max())
            contacts.append(Contact(*key, first, last, self.depths[key], force))  # type: ignore[arg-type]
        return tuple(
            sorted(
                contacts,
                key=lambda contact: (contact.first_s, contact.one, contact.other),
            )
        )

    def _force(self, key: Key) -> Array:
        """The normal force of a contact while it lasts, N, (T,); a component has that of the tool."""
        kind, one, other = key
        names = ("tool" if kind == "tool" else one, other)
        forces = self.taken.forces.get(
            names, self.taken.forces.get(names[::-1], np.zeros(len(self.taken.times)))
        )
        return forces * self.touching[key]

    def with_robot(self, body: str) -> Flags:
        """Report at which samples (T,) the arm or the tool touches a body."""
        flags = [
            each
            for (kind, _, other), each in self.touching.items()
            if kind != "body" and other == body
        ]
        touched: Flags = np.any(
            [np.zeros(len(self.taken.times), dtype=bool), *flags], axis=0
        )
        return touched

    def held(self, body: str) -> Flags:
        """Report at which samples (T,) the robot touches a body, or another body that touches it."""
        held = self.with_robot(body)
        for (kind, one, other), flags in self.touching.items():
            if kind == "body" and body in (one, other):
                held |= flags & self.with_robot(other if one == body else one)
        return held


def find_contacts(
    scene: Scene, robot: Robot, tool: Tool, recording: Recording
) -> Contacts:
    """Find the contacts of a rollout of ``tool`` in ``scene``, at samples about `SAMPLE_HZ` apart."""
    taken = subset(recording, coarse_samples(recording))
    tracks = follow(scene, robot, tool, taken)
    own = [track for track in tracks if track.owner == ROBOT]
    links, mounts = len(own) - len(tool.parts), tool.mounts
    kinds = [
        "tool" if i >= links or track.name in mounts else "arm"
        for i, track in enumerate(own)
    ]
    struck = _struck(taken)
    touching: dict[Key, Flags] = {}
    depths: dict[Key, float] = {}
    met: list[
        tuple[int, Pair]
    ] = []  # where parts of the tool first touched bodies that can move
    pairs = neighbours(tracks, TOUCH_M + 2 * HULL_M, scene.joined)
    for (i, j), near, hit in zip(
        pairs.tolist(), *_near(tracks, pairs, struck), strict=True
    ):
        if not (near.any() or hit.any()):
            continue
        pair = Pair(tracks[i], tracks[j])
        key = kinds[i] if i < len(own) else "body", pair.one.name, pair.other.name
        touched, depth = _touched(pair, near, hit)
        if touched.any():
            touching[key] = touching.get(key, False) | touched
            depths[key] = max(depth, depths.get(key, depth))
            if key[0] == "tool" and not scene[pair.other.owner].fixed:
                met.append((int(touched.argmax()), pair))
    softs, bodies = (
        {soft.name for soft in scene.softs},
        {body.name for body in scene.bodies},
    )
    for (
        (one, other),
        force,
    ) in taken.forces.items():  # of soft bodies engines alone know what they touch
        if softs & {one, other}:
            kind = (
                "body"
                if one in bodies
                else "tool"
                if one == "tool" and tool.components
                else "arm"
            )
            touching[kind, one, other], depths[kind, one, other] = force > 0, 0.0
    settled = int(np.searchsorted(taken.times, 0.0, side="right"))
    resting = frozenset(
        key
        for key, touched in touching.items()
        if key[0] == "body" and touched[:settled].any()
    )
    missed = bodies - {other for kind, _, other in touching if kind != "body"}
    gaps = nearest(own, [track for track in tracks if track.owner in missed])
    clearances = {name: gap for name, (gap, _) in gaps.items()}
    return Contacts(
        taken,
        touching,
        resting,
        depths,
        clearances,
        _first_touch(robot, tool, taken, met),
    )


def make_trace(scene: Scene, worlds: Sequence[Contacts]) -> Trace:
    """Make the trace of rollouts in a scene, one world for each.

    What the robot touched and pressed before its motion began counts at 0, and between two instants at the nearest. A
    body that it only touched between two samples of a recording is one that it pressed.
    """
    last = max(float(world.taken.times[-1]) for world in worlds)
    instants = np.arange(math.ceil(last * TRACE_HZ - 1e-6) + 1) / TRACE_HZ
    times = [world.taken.times for world in worlds]
    samples = [
        np.searchsorted((each[1:] + each[:-1]) / 2, instants) for each in times
    ]  # the nearest
    films = [
        subset(world.taken, chosen).states
        for world, chosen in zip(worlds, samples, strict=True)
    ]
    touching: dict[Key, Flags] = {}
    forces: dict[tuple[str, str], Array] = {}
    bodies = {body.name for body in scene.bodies}
    for number, (world, chosen) in enumerate(zip(worlds, samples, strict=True)):
        skipped = np.setdiff1d(np.arange(len(world.taken.times)), chosen)
        nearest = np.clip(
            np.rint(world.taken.times[skipped] * TRACE_HZ).astype(int),
            0,
            len(instants) - 1,
        )
        begun = world.taken.times[skipped] >= 0
        for key, flags in world.touching.items():
            own = touching.setdefault(
                key, np.zeros((len(worlds), len(instants)), dtype=bool)
            )[number]
            own[:] = flags[chosen]
            np.logical_or.at(
                own, nearest, flags[skipped] & (begun | (key[0] != "body"))
            )
        for pair, values in world.taken.forces.items():
            borne = forces.setdefault(pair, np.zeros((len(worlds), len(instants))))[
                number
            ]
            borne[:] = values[chosen]
            robots = pair[0] not in bodies
            np.maximum.at(borne, nearest, values[skipped] * (begun | robots))
            if robots and not world.with_robot(pair[1]).any():
                kind = "tool" if pair[0] == "tool" else "arm"
                flags = touching.setdefault(
                    (kind, *pair), np.zeros((len(worlds), len(instants)), dtype=bool)
                )
                flags[number] |= borne > 0
    measured = (
        forces or not touching
    )  # an engine that measures none has none where things touch
    clearances = {
        name: np.array([world.clearances.get(name, 0.0) for world in worlds])
        for name in bodies
    }
    return Trace(
        instants,
        scene.complete(State.stack(films)),
        touching,
        forces if measured else None,
        clearances,
    )


def _near(
    tracks: Tracks, pairs: Indices, struck: Mapping[str, Flags]
) -> tuple[Flags, Flags]:
    """Report in which intervals each pair may touch, and in which one was struck near the other: (P, T - 1)."""
    never = np.zeros(tracks.samples - 1, dtype=bool)
    hits = np.array([struck.get(owner, never) for owner in tracks.solids.owners])
    hit = hits[pairs[:, 0]] | hits[pairs[:, 1]]
    most = np.array([touch(tracks[i], tracks[j]) for i, j in pairs.tolist()])
    return may_meet(tracks, pairs, -most, np.ones_like(hit)), may_meet(
        tracks, pairs, np.full(len(pairs), -STRUCK_M), hit
    )


def touch(one: Track, other: Track) -> float:
    """The gap up to which two solids are in contact, metres."""
    return TOUCH_M + HULL_M * sum(
        track.shape is None or isinstance(track.shape, Mesh) for track in (one, other)
    )


def _touched(pair: Pair, near: Flags, struck: Flags) -> tuple[Flags, float]:
    """Report at which samples (T,) two solids touch, and how deep they are in each other at most, metres.

    They also touch at the end of an interval (T - 1,) in which one of them is ``struck``, if they may have met in it.
    """
    samples = np.flatnonzero(
        np.append(near | struck, False) | np.append(False, near | struck)
    )
    most = touch(pair.one, pair.other)
    gaps = pair.gaps(samples)
    touched = np.zeros(len(near) + 1, dtype=bool)
    touched[samples] = gaps <= most
    if (hit := np.flatnonzero(struck)).size:
        travel = np.diff(pair.travel)[hit]
        before, after = (
            gaps[np.searchsorted(samples, hit + later)] for later in (0, 1)
        )
        touched[hit[before + after - travel <= 2 * most] + 1] = True
    return touched, -float(gaps.min())


def _struck(recording: Recording) -> dict[str, Flags]:
    """Report for each free body in which intervals (T - 1,) its velocity changes abruptly."""
    states = recording.states
    changes = np.linalg.norm(np.diff(states.linear_velocities, axis=0), axis=2)
    limits = STRUCK_M_S + 9.81 * np.diff(recording.times)[:, None]  # it may fall
    return dict(zip(states.names, (changes > limits).T, strict=True))


def nearest(
    robot: Sequence[Track], bodies: Sequence[Track], most: int | None = 40
) -> dict[str, tuple[float, int]]:
    """Find the smallest distance of the robot to each body, metres, and when, with ``most`` queries of a track."""
    if not robot or not bodies:
        return {}
    middles, extents = (np.array(each) for each in zip(*map(_box, robot), strict=True))
    found: dict[str, tuple[float, int]] = {}
    for body in bodies:
        middle, extent = _box(body)
        apart = np.maximum(np.abs(middles - middle) - extents - extent, 0.0)
        bounds = np.sqrt((apart * apart).sum(axis=2))  # (robot, T)
        best = found.get(body.owner, (np.inf, 0))
        for index in np.argsort(bounds, axis=None)[:most].tolist():
            number, sample = divmod(index, bounds.shape[1])
            if bounds[number, sample] >= best[0]:
                break
            best = min(best, (-Pair(robot[number], body).look(sample).depth, sample))
        found[body.owner] = best
    return found


def _first_touch(
    robot: Robot, tool: Tool, taken: Recording, met: Sequence[tuple[int, Pair]]
) -> float | None:
    """Measure the distance from the mount's origin to the first contact: the nearest point of the tool, metres."""
    if not met:
        return None
    sample, pair = min(met, key=lambda first: first[0])
    name = pair.one.name
    mount = name if name in tool.mounts else tool.placed()[name][0]
    frames = link_frames(robot, tool, taken.arm[[sample]], taken.fingers[[sample]])
    return float(lengths(pair.look(sample).nearest - frames[mount][1][0]))


def _box(track: Track) -> tuple[Array, Array]:
    """Middles and half lengths (T, 3) of the bounding boxes along the world's axes."""
    return track.middles, np.abs(track.rotations) @ track.box

"""Find what the engine let happen and the real world would not: solids that pass through each other, bodies flung away.

Only recordings are read, so engines need not know of it. The steps stand in docs/physics_explained.md.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.interfaces import Recording, Robot
from core.scene import Scene
from core.solids.near_pairs import Flags, may_meet, neighbours
from core.solids.passage import (
    DEEP_S,
    Depths,
    choose_depths,
    find_passage,
    relative_ways,
)
from core.solids.record_rate import (
    coarse_samples,
    detours,
    is_finite,
    refined_samples,
    subset,
)
from core.solids.rollout_solids import ROBOT
from core.solids.soft_cuts import Cut, find_cuts
from core.solids.soft_passages import find_soft_passages
from core.solids.tracks import (
    SAMPLE_HZ,
    Indices,
    Tracks,
    follow,
    lengths,
)

FLUNG_M_S = 5.0  # a body was flung if it is faster than this, and
FLUNG_TIMES = 2.2  # so many times as fast as the robot ever was: an elastic blow gives twice the speed; and a tenth
LOST_M = 5.0  # from the arm's base
EXPLODED_M_S = 100.0
# How far a tool's joint may go beyond its range, rad or m, as stops are soft; and the unit.
OVERRUN = {"hinge": (0.1, "rad"), "slider": (0.003, "m")}


class Finding(NamedTuple):
    """Something unphysical.

    Attributes:
        text: describes it in words.
        penetration: whether a reward that came of it means nothing.
    """

    text: str
    penetration: bool


class Explosion(Exception):
    """The simulation diverged; the message says how."""


def findings(
    scene: Scene,
    robot: Robot,
    tool: Tool,
    recording: Recording,
    excused: Collection[str] = (),
) -> list[Finding]:
    """Find what is unphysical in a rollout.

    There is one finding for each two things that passed through each other, at the first time, one for each joint of
    the tool that went beyond its range, and one for each body that was flung. The robot's own parts are not compared
    with each other, nor solids that overlap from the start.

    Args:
        scene: its bodies, of which those that are joined are not compared.
        robot: the arm.
        tool: what it holds.
        recording: of the rollout, as finely as `sample_hz` asks for.
        excused: bodies on joints that may be pressed as deep into others as what hangs from none.

    Raises:
        Explosion: a body's state is not finite, or it is faster than `EXPLODED_M_S` without a fall to explain it.
    """
    if not is_finite(recording):
        raise Explosion("a body's state is not finite")

    unpressed = replace(recording, forces={})
    samples = coarse_samples(recording)
    coarse = subset(unpressed, samples)
    tracks = follow(
        scene, robot, tool, coarse, detours(recording, samples, robot.slides)
    )
    flung = _find_flung(scene, coarse, tracks)
    cuts = [*find_cuts(scene, tracks, coarse.states)]
    passed = [*find_soft_passages(scene, tracks, coarse.states)]
    if passed and len(samples) < len(recording.times):
        # Between two samples a rope may have whipped around the end of a bar.
        finer = follow(scene, robot, tool, unpressed)
        passed = [*find_soft_passages(scene, finer, recording.states)]

    pairs = neighbours(tracks, 0.0, scene.joined)
    guided = {joint.body for joint in scene.joints}.difference(excused)
    depths = choose_depths(tracks.solids, pairs, guided)
    meetings = _Meetings(tracks, pairs, depths)
    wanted = meetings.count_looks()

    if (wanted > 1).any() and len(samples) < len(recording.times):
        chosen = refined_samples(samples, wanted)  # elsewhere no two move near others
        before = np.searchsorted(samples, chosen[:-1], side="right") - 1
        closer = subset(unpressed, chosen)
        tracks = follow(scene, robot, tool, closer)
        within = meetings.near[:, before]
        meetings = _Meetings(tracks, meetings.pairs, meetings.depths, within)

    return [
        *meetings.find_passages(),
        *(_describe_cut(cut) for cut in cuts),
        *(_describe_soft_passage(cut) for cut in passed),
        *flung,
        *_find_overrun(tool, recording),
    ]


def _describe_cut(cut: Cut) -> Finding:
    depth = f"{1000 * cut.depth_m:.0f} mm deep inside the soft {cut.soft!r}"
    return Finding(f"{cut.name!r} was {depth} at {cut.time_s:.2f} s", penetration=True)


def _describe_soft_passage(cut: Cut) -> Finding:
    text = f"the soft {cut.soft!r} went through {cut.name!r} at {cut.time_s:.2f} s"
    return Finding(text, penetration=True)


class _Meetings:
    """P pairs of solids that may get as deep in each other as counts.

    They are made twice: by all pairs at coarse samples, and then, where that is too coarse, by what is left of them.

    Attributes:
        tracks: the solids at T samples.
        depths: (P,) those of each pair.
        pairs: (P, 2) the solids' numbers among the ``tracks``.
        near: (P, T - 1) in which intervals they may.
        ways: (P, T - 1) how far the first moves in the frame of the second, metres, at most.
    """

    def __init__(
        self,
        tracks: Tracks,
        pairs: Indices,
        depths: Depths,
        within: Flags | bool = True,
    ) -> None:
        near = may_meet(tracks, pairs, depths.least, within)
        met = near.any(axis=1)
        self.tracks = tracks
        self.pairs = pairs[met]
        self.depths = Depths(*(values[met] for values in depths))
        self.near = near[met]
        self.ways = relative_ways(tracks, self.pairs, self.near)

    def count_looks(self) -> Array:
        """How often to look in each interval (T - 1,): once each time that solids move as far as they are thick.

        It is 0 where none are near each other, nor were shortly before.
        """
        tracks = self.tracks
        pair, interval = np.nonzero(self.near)
        aside = tracks.rows.aside[self.pairs[pair].T, interval].sum(axis=0)
        ways = self.ways[pair, interval] + 2 * aside  # there and back
        looks = np.zeros(self.near.shape[1])
        np.maximum.at(looks, interval, np.maximum(ways / self.depths.thick[pair], 1.0))

        for _ in range(math.ceil(DEEP_S * SAMPLE_HZ)):
            # What comes to rest is near no more, but may stay too deep.
            looks[1:] = np.maximum(looks[1:], looks[:-1] > 0)

        return looks

    def find_passages(self) -> Iterator[Finding]:
        """Find the first passage of each two things.

        Things may have many solids; that of the earliest passage counts.
        """
        tracks = self.tracks
        passages: dict[tuple[str, str], tuple[float, str]] = {}
        depths = np.array(self.depths).T.tolist()

        for number, numbers in enumerate(self.pairs):
            pair = tracks.pair(numbers)
            near = np.flatnonzero(self.near[number])
            ways = self.ways[number]
            limits = Depths(*depths[number])
            passage = find_passage(pair, near, ways, limits, tracks.times)

            if passage is not None:
                names = pair.first.name, pair.second.name
                passages[names] = min(passages.get(names, passage), passage)

        for (name, other), (_, text) in passages.items():
            yield Finding(f"{name!r} {text.format(repr(other))}", penetration=True)


def _find_overrun(tool: Tool, recording: Recording) -> Iterator[Finding]:
    """Find joints of the tool that stay beyond their range: a light part may be pressed through an engine's stop.

    Args:
        tool: gives the ranges of its K joints.
        recording: ``fingers`` end with the joints of the tool.
    """
    fingers = recording.fingers.T
    loose = fingers[len(fingers) - len(tool.bearers) :]

    for bearer, values in zip(tool.bearers, loose, strict=True):
        joint = bearer.joint
        most, unit = OVERRUN[joint.kind]
        beyond = np.maximum(joint.lower - values, values - joint.upper)
        over = (beyond > most)[1:]

        if np.diff(recording.times)[over].sum() > DEEP_S:
            first = recording.times[1:][over.argmax()]
            text = f"{bearer.name!r} went {beyond.max():.3g} {unit} beyond the range of its joint from {first:.2f} s on"
            yield Finding(text, penetration=True)


def _find_flung(scene: Scene, recording: Recording, tracks: Tracks) -> list[Finding]:
    """Find bodies faster than the robot and a fall can have made them, and bodies that are far away.

    Args:
        scene: its gravity makes what falls fast.
        recording: how the free bodies move.
        tracks: of the robot.

    Raises:
        Explosion: one is faster than `EXPLODED_M_S`.
    """
    states = recording.states
    ways = states.positions - states.positions[:1]
    gained = np.maximum(ways @ np.asarray(scene.gravity), 0.0)
    squares = (states.linear_velocities**2).sum(axis=2) - 2 * gained
    fastest = np.sqrt(np.maximum(squares, 0.0).max(axis=0))
    farthest = lengths(states.positions[:, :, :2]).max(axis=0)
    ends = states.positions[-1, :, 2]
    texts = []

    for name, speed, far, end in zip(
        states.names, fastest, farthest, ends, strict=True
    ):
        if speed > EXPLODED_M_S:
            raise Explosion(f"{name!r} reached {speed:.0f} m/s")
        robots = _bound_robots_speed(tracks) if speed > FLUNG_M_S else 0.0
        if speed > max(FLUNG_M_S, FLUNG_TIMES * robots):
            reached = f"it reached {speed:.1f} m/s, the robot {robots:.1f} m/s"
            texts.append(f"{name!r} was flung: {reached}")
        elif abs(end) > LOST_M:
            texts.append(f"{name!r} left the scene: it got to z = {end:.0f} m")
        elif far > LOST_M:
            texts.append(f"{name!r} is far away: it got to {far:.1f} m from the robot")

    return [Finding(text, penetration=False) for text in texts]


def _bound_robots_speed(tracks: Tracks) -> float:
    """Bound the speed of any point of the robot, averaged over a tenth of a second.

    Args:
        tracks: of all solids, those of the robot among them.

    Returns:
        The speed, m/s.
    """
    times = tracks.times
    count = max(1, min(len(times) - 1, round(0.1 * SAMPLE_HZ)))
    robots = [track.travel for track in tracks.items if track.owner == ROBOT]
    travel = np.reshape(robots, (-1, len(times)))
    moved = travel[:, count:] - travel[:, :-count]

    return float((moved / (times[count:] - times[:-count])).max(initial=0.0))

"""Foresee what a motion meets on its way in, from its plan alone: nothing is played, and bodies stay where they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from core.design import Foreseen
from core.interfaces import Recording, Rollout, Task
from core.robot.trajectory import Motion
from core.scene import Scene
from core.solids.bodies import ROBOT
from core.solids.gap_bounds import may_meet, neighbours, spans
from core.solids.tracks import SAMPLE_HZ, Indices, Pair, Tracks, follow

MET_M = 0.002  # so deep a part of the robot gets into a body
DIP_M, NEAR_M = 0.002, 0.005  # so much lower than at both ends of a way the tool gets, and so near to a body


def foresee(task: Task, scene: Scene, motion: Motion, job: Rollout) -> Iterator[Foreseen]:
    """Yield what the robot meets first on its way to work, and where its tool dips.

    Work begins with a guard, or where the robot touches what can move and is not to be left alone, but not on the way
    to the first waypoint. Bodies that move by themselves are left out, and parts on a joint of the tool.
    """
    until, arrivals, tool = motion.trajectory.duration, motion.arrivals, job.tool
    if job.guards is not None:
        job.guards.begin()
        until = min(until, job.guards.since)
    times = np.unique(np.concatenate([np.arange(0.0, until, 1 / SAMPLE_HZ), [0.0], arrivals[arrivals <= until]]))
    arm, opening = motion.trajectory.sample(times)
    fingers = np.outer(opening, [1.0] * len(task.robot.finger_joints) + [0.0] * len(tool.bearers))
    states = scene.state().each(lambda array: np.repeat(array[None], len(times), axis=0))
    tracks = follow(scene, task.robot, tool, Recording(times, arm, fingers, states))
    left_out = {body.name for body in scene.bodies if body.launched} | {j.body for j in scene.joints if j.drive}
    left_out |= {name for name, (bearer, _) in tool.borne.items() if bearer not in tool.mounts}
    left_alone = {name for goal in task.goals for name in (*goal.untouched, *goal.keep)}
    loose = {body.name for body in scene.free} - left_alone
    solids = tracks.solids.items
    own = [i for i, solid in enumerate(solids) if solid.owner == ROBOT and solid.name not in left_out]
    pairs = neighbours(tracks, NEAR_M)
    pairs = pairs[[i in own and solids[j].owner not in left_out for i, j in pairs.tolist()]]
    near = may_meet(tracks, pairs, np.zeros(len(pairs)), np.ones((len(pairs), tracks.samples - 1), dtype=bool))
    last, waypoints = len(times) - 1, np.searchsorted(arrivals, times) + 1
    for k in np.flatnonzero(near.any(axis=0)).tolist():
        gaps = [(Pair(tracks[i], tracks[j]).gap(k), i, j) for i, j in pairs[near[:, k]].tolist()]
        work = [gap for gap in gaps if waypoints[k] > 1 and solids[gap[2]].owner in loose]
        gap, i, j = min([found for found in gaps if found not in work], default=(0.0, 0, 0))
        if gap < -MET_M:
            last = int(np.flatnonzero(waypoints == waypoints[k])[-1])
            deep = max(-Pair(tracks[i], tracks[j]).gap(at) for at in range(k, last + 1))
            what = f"on the way to waypoint {waypoints[k]} {solids[i].name} meets {solids[j].owner}"
            yield Foreseen(what, 1000 * deep, "deep")
            break
        if any(gap < 0 for gap, *_ in work):
            last = k
            break
    ends = np.searchsorted(times, [0.0, *arrivals[arrivals <= times[last]]])
    yield from _dips(tracks, pairs, [i for i in own if solids[i].name in tool.borne], ends.tolist())


def _dips(tracks: Tracks, pairs: Indices, tool: Sequence[int], ends: Sequence[int]) -> Iterator[Foreseen]:
    """Find ways from one of ``ends`` to the next on which the tool gets near a body, and lower than at both."""
    parts = [tracks[i] for i in tool]
    lows = np.array([spans(p, p.rotations[:, 2, :, None])[0][:, 0] + p.positions[:, 2] for p in parts])
    low = lows.min(axis=0, initial=np.inf)
    for number, (begin, end) in enumerate(pairwise(ends) if tool else (), start=1):
        k = begin + int(low[begin : end + 1].argmin())
        deep, lowest = min(low[begin], low[end]) - low[k], tool[int(lows[:, k].argmin())]
        beside = (tracks[j] for i, j in pairs.tolist() if i == lowest and deep > DIP_M)
        if body := next((body.owner for body in beside if Pair(tracks[lowest], body).gap(k) <= NEAR_M), None):
            what = f"on the way to waypoint {number} the lowest point of the tool dips"
            yield Foreseen(what, 1000 * float(deep), f"below both ends, near {body}")

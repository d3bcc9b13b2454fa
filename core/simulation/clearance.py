"""Foresee without physics that a robot keeps clear of everything, so that its rollout leaves the scene as it is."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from core.design import Tool
from core.interfaces import JointTrajectory, Outcome, Recording, Robot, Rollout, RolloutSettings, Simulator, Task
from core.robot.trajectory import at_home
from core.scene import Scene, State
from core.solids.gap_bounds import may_meet, neighbours
from core.solids.tracks import SAMPLE_HZ, follow

DEEP_M = 0.005  # a motion that leads farther into a fixed body is pushed off its way
REST = 0.001  # a body whose position (m) or quaternion changes by more in the time below is not at rest
REST_S = 1.0


@dataclass(frozen=True, eq=False)
class Idle:
    """A layout in one engine while the robot rests at home: nothing moves, and the reward is 0.

    Attributes:
        outcome: of that rollout.
        scene: its bodies, where they rest, all made fixed.
        fixed: the names of those that never move.
        share: the seconds of processor time that a second of a rollout takes.
    """

    outcome: Outcome
    scene: Scene
    fixed: frozenset[str]
    share: float

    def foresee(self, robot: Robot, job: Rollout, margin: float) -> Outcome | None:
        """Return the outcome of a rollout that touches nothing; None: it may touch something.

        The arm with its tool keeps at least ``margin`` metres from what can move, and gets no deeper than `DEEP_M` into
        what can't.
        """
        if job.tool.bearers:  # where its joints go is unknown
            return None
        recording = _recording(robot, job.trajectory)
        tracks = follow(self.scene, robot, job.tool, recording)
        pairs = neighbours(tracks, margin)
        fixed = np.array([owner in self.fixed for owner in tracks.solids.owners])
        every = np.ones((len(pairs), len(recording.times) - 1), dtype=bool)
        met = may_meet(tracks, pairs, np.where(fixed[pairs[:, 1]], DEEP_M, -margin), every).any()
        return None if met else self.outcome

    def film(self, robot: Robot, job: Rollout) -> Recording:
        """Return the recording of a rollout that touches nothing."""
        made = _recording(robot, job.trajectory)
        assert self.outcome.end is not None
        return replace(made, states=State.stack([self.outcome.end] * len(made.times)))


def _recording(robot: Robot, trajectory: JointTrajectory) -> Recording:
    """The trajectory as a recording in which each joint is where it should be."""
    times = np.append(np.arange(0.0, trajectory.duration, 1 / SAMPLE_HZ), trajectory.duration)
    arm, opening = trajectory.sample(times)
    fingers = np.repeat(opening[:, None], len(robot.finger_joints), axis=1)
    nothing = np.zeros((len(times), 0, 3))
    return Recording(times, arm, fingers, State((), nothing, np.zeros((len(times), 0, 4)), nothing, nothing))


def find_idle(task: Task, simulator: Simulator, seed: int, settings: RolloutSettings) -> Idle | None:
    """Play a layout with the robot at rest; None: something moves, or the reward may be other than 0.

    A reward that reads a trace may count more than where bodies are, and a drive may begin later.
    """
    scene = task.scene(seed)
    moving = any(body.launched for body in scene.bodies) or any(joint.drive is not None for joint in scene.joints)
    if task.reads_trace or moving:
        return None
    job = Rollout(Tool(), at_home(task), seed, settings.settle_s, max(settings.hold_s, task.hold_s, REST_S))
    began = time.process_time()
    (outcome,) = simulator.rollout(task, [job])
    took = time.process_time() - began
    start, end = outcome.start, outcome.end
    if outcome.error is not None or start is None or end is None:
        return None
    moved = np.concatenate([end.positions - start.positions, end.quaternions - start.quaternions], axis=-1)
    if not np.abs(moved).max(initial=0.0) < REST:
        return None
    if float(np.asarray(task.reward(scene.complete(start), scene.complete(end)))) != 0:
        return None
    poses = {name: end.pose(name) for name in end.names}
    free = tuple(replace(body, pose=poses[body.name], mass=0.0) for body in scene.free if body.name in poses)
    fixed = tuple(body for body in scene.bodies if body.fixed)
    names = frozenset(body.name for body in fixed)
    return Idle(outcome, Scene((*fixed, *free)), names, took / (job.settle_s + job.hold_s))

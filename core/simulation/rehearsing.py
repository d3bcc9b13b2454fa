"""Play a planned motion by kinematics, without physics: where the robot is, and what it would meet.

Bodies stay where they begin, no guard fires, and every look sees the start. So what stands still, and what must not be
touched, is said exactly; of all else it is said as long as nothing was touched.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from core.design import Candidate, DesignError
from core.geometry import Array, Pose
from core.goals.evidence import Evidence
from core.goals.limit import limits
from core.interfaces import Motion, Recording
from core.robot.kinematics import arm_of, finger_values, link_frames
from core.scene import State
from core.simulation.attempt import (
    Attempt,
    Stage,
    plan_attempt,
    prepare,
    stage_of,
)
from core.solids.contacts import Contacts, find_contacts, make_trace, nearest
from core.solids.record_rate import subset
from core.solids.rollout_solids import ROBOT
from core.solids.tracks import follow
from core.trial import Condition
from core.values.traces import TRACE_HZ

DEEP_M = 0.003  # so deep in what is fixed the robot is not by resting on it


class Meeting(NamedTuple):
    """The robot meets something that it should not: a sentence's end, and when first, seconds."""

    text: str
    time_s: float


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """A candidate's motion in a condition, as it is planned.

    Attributes:
        stage: the condition.
        planned: the candidate with its motion.
        recording: the motion at T samples, at its waypoints and `TRACE_HZ` apart; the bodies stay where they begin.
    """

    stage: Stage
    planned: Attempt
    recording: Recording = field(init=False)

    def __post_init__(self) -> None:
        trajectory = self.planned.job.trajectory
        duration = trajectory.duration
        even = np.linspace(0.0, duration, 2 + int(duration * TRACE_HZ))
        times = np.union1d(even, np.clip(self.motion.arrivals, 0.0, duration))
        arm, opening = trajectory.sample(times)
        robot = self.stage.task.robot
        fingers = finger_values(robot, self.planned.job.tool, opening)
        still = State.stack([self.planned.scene.state()] * len(times))
        object.__setattr__(self, "recording", Recording(times, arm, fingers, still))

    @property
    def motion(self) -> Motion:
        return self.planned.motion

    @property
    def is_certain(self) -> bool:
        """Whether nothing moves by itself, and neither guards nor looks change the motion."""
        scene = self.planned.scene
        moves = any(joint.drive for joint in scene.joints)
        moves = moves or any(body.launched for body in scene.bodies)
        return not moves and self.planned.job.reactions is None

    @cached_property
    def contacts(self) -> Contacts:
        """What the robot would touch, and how near it would come to all else."""
        job = self.planned.job
        robot = self.stage.task.robot
        return find_contacts(self.planned.scene, robot, job.tool, self.recording)

    def find_sample(self, waypoint: int | None, time_s: float | None) -> int:
        """Return the number of the sample at a waypoint, from 1, or at an instant, seconds; without either the last.

        Raises:
            DesignError: there is no such waypoint.
        """
        arrivals = self.motion.arrivals
        if waypoint is not None:
            if not 1 <= waypoint <= len(arrivals):
                raise DesignError(
                    f"there is no waypoint {waypoint}; the plan has {len(arrivals)} as it is carried out here"
                )
            time_s = float(arrivals[waypoint - 1])
        if time_s is None:
            return len(self.recording.times) - 1
        return int(np.abs(self.recording.times - time_s).argmin())

    def find_waypoint(self, time_s: float) -> int:
        """Return the number of the waypoint, from 1, that the arm is on its way to at an instant, seconds."""
        arrivals = self.motion.arrivals
        later = int(np.searchsorted(arrivals, time_s - 1e-9))
        return min(later + 1, len(arrivals))

    def place_hand(self, sample: int) -> Pose:
        """Return the pose of the end-effector."""
        return arm_of(self.stage.task.robot).forward(self.recording.arm[sample])

    def place_tool(self, sample: int) -> dict[str, Array]:
        """Return where the middle of each component of the tool is, in the world (3,), metres."""
        tool = self.planned.job.tool
        taken = self.recording
        arm = taken.arm[[sample]]
        frames = link_frames(self.stage.task.robot, tool, arm, taken.fingers[[sample]])
        places = {}
        for name, (bearer, pose) in tool.borne.items():
            if bearer in frames:
                rotations, positions = frames[bearer]
                places[name] = positions[0] + rotations[0] @ pose.position
        return places

    def measure_gaps(self, sample: int) -> dict[str, tuple[float, str]]:
        """Measure how far each body is from the robot, metres, below 0 inside it, and from which part of it."""
        recording = subset(self.recording, np.array([sample]))
        job = self.planned.job
        scene = self.planned.scene
        tracks = follow(scene, self.stage.task.robot, job.tool, recording)
        robots = [track for track in tracks.items if track.owner == ROBOT]
        others = [track for track in tracks.items if track.owner != ROBOT]
        found = nearest(robots, others)
        return {name: (near.gap_m, near.part) for name, near in found.items()}

    def find_meetings(self) -> list[Meeting]:
        """Find what the robot goes into that is fixed, and what it touches that nothing may touch, the first first."""
        found = [*self._find_breaches(), *self._find_depths()]
        return sorted(found, key=lambda meeting: (meeting.time_s, meeting.text))

    def _find_breaches(self) -> Iterator[Meeting]:
        """Ask the task's limits what they say of a world in which the robot alone moves."""
        taken = self.contacts.taken
        if len(taken.times) < 2 or not self.planned.scene.bodies:
            return
        trace = make_trace(self.planned.scene, self.contacts)
        start = trace.states[0]
        goals = self.stage.task.goals
        evidence = Evidence(start, start, trace, goals)
        for limit in limits(goals):
            for breach in limit.breaches(evidence):
                yield Meeting(breach.text, breach.time_s)

    def _find_depths(self) -> Iterator[Meeting]:
        contacts = self.contacts
        for key, depth in contacts.depths.items():
            kind, part, other = key
            scene = self.planned.scene
            if kind == "body" or depth < DEEP_M or not scene[other].fixed:
                continue
            first = int(contacts.touching[key].argmax())
            deep = f"{1000 * depth:.0f} mm into the fixed {other}"
            yield Meeting(f"{part} goes {deep}", float(contacts.taken.times[first]))


def rehearse(
    condition: Condition, candidate: Candidate, *, checks: bool = True
) -> Rehearsal:
    """Plan a candidate's motion in a condition.

    Args:
        condition: where it would be played.
        candidate: the tool and its plan.
        checks: refuse what would be rejected there; else only what can't be planned.

    Raises:
        DesignError: it would be rejected; says why.
    """
    stage = stage_of(condition)
    if checks:
        planned = plan_attempt(stage, candidate)
        if planned.trial is not None:
            raise DesignError(planned.trial.reason)
        return Rehearsal(stage, planned)

    planned = Attempt(condition.perturb(candidate))
    planned.motion, planned.job = prepare(
        stage.task, candidate, condition.layout, stage.settings, scene=stage.scene
    )
    return Rehearsal(stage, planned)

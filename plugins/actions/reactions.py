"""Play motions that feel and look: where a guard fires the arm stops, and what comes next is planned from there.

The motion up to the first look is planned at first, as if no guard fired, so that a plan can be refused before it is
tried. After a look the way to the next one is planned, from where the arm is.

A guard reads what an arm with torque sensors reports: the force at its flange, estimated from its joints' torques. The
engine gives the contact forces. The arm's Jacobian makes joint torques of them, and each torque gets the sensor's
noise. Least squares make a force of the torques again, so that an arm near a singularity estimates badly. Weight and
inertia are taken as known. The first reading of a guarded way counts as zero. Of three readings in a row the middle one
counts, so that one peak of an impact does not fire a guard.
"""

from __future__ import annotations

import math

import numpy as np

from core.design import DesignError
from core.geometry import Array, Pose, step_lengths
from core.interfaces import (
    Begin,
    Felt,
    Guard,
    JointTrajectory,
    Looked,
    Motion,
    PlannedMotion,
    Sighted,
    Tempo,
    Waypoints,
)
from core.robot.feeling import ForceSense, Watch, bring_to_rest
from core.robot.kinematics import arm_of
from core.scene import State
from core.values.jobs import FEEL_S


class PlannedReactions:
    """The guards and looks of one candidate's plan in one layout, see `core.interfaces.Reactions`.

    The playback calls `begin`, then `feel` with each reading once the motion is at ``since``, and `look` when it is at
    ``looks_at``.

    Args:
        planned: the motion up to the first look, as it is planned as if no guard fired.
        feels: whether any part of the plan has guards.
        looks: whether it looks again.

    Attributes:
        motion: as it is planned now; after a rollout, as it was played.
        felt: how its guards ended so far.
        looked: what its looks found out so far.
        problem: why the rest could not be planned; the motion ended there.
        since: when the way to the next guard begins, seconds; infinity: there is none.
        looks_at: when the next look is taken, seconds; infinity: there is none, or a guard comes first.
    """

    def __init__(self, planned: PlannedMotion, *, feels: bool, looks: bool) -> None:
        self.feels = feels
        self.looks = looks
        self._planned = planned
        self._settings = planned.settings
        self._arm = arm_of(planned.robot)
        self.begin()

    def begin(self) -> JointTrajectory:
        """See `core.interfaces.Reactions`."""
        self._waypoints = self._planned.waypoints
        motion = self._planned.motion
        self.motion = motion
        self.felt: tuple[Felt, ...] = ()
        self.looked: tuple[Looked, ...] = ()
        self.problem: str | None = None
        self._sightings: tuple[Sighted, ...] = ()
        self._ended = False
        self._poses: tuple[Pose | None, ...] = ()
        noise = self._settings.feel.noise
        self._sense = ForceSense(self._arm, noise, self._planned.layout)
        self._find_next(0)

        return motion.trajectory

    @property
    def _tempo(self) -> Tempo:
        return self._waypoints.tempo or Tempo.usual(len(self._waypoints))

    def _find_next(self, after: int) -> None:
        """Find the next guard among the planned waypoints, and the time of its way.

        Args:
            after: the first waypoint that is looked at, from 0.
        """
        arrivals = self.motion.arrivals
        guards = self._waypoints.guards[: len(arrivals)]
        self._watch: Watch | None = None
        self.since = math.inf
        self.looks_at = math.inf
        self._until = math.inf

        guarded = [k for k in range(after, len(guards)) if guards[k] is not None]
        self._number = min(guarded, default=None)
        if self._number is None:
            if self._is_look_next:
                self.looks_at = self.motion.trajectory.duration
            return

        guard = guards[self._number]
        assert guard is not None
        self._watch = Watch(guard, self._arm, self._settings.feel)
        leaves = np.append(0.0, arrivals + self._tempo.waits[: len(arrivals)])
        self.since = float(leaves[self._number])
        self._until = float(leaves[self._number + 1])

    @property
    def _is_look_next(self) -> bool:
        """Whether the plan looks where the motion, as it is planned now, ends."""
        is_whole = len(self.motion.arrivals) == len(self._waypoints)
        waits = len(self._waypoints.looks) > len(self._sightings)
        return is_whole and waits and not self._ended and self.problem is None

    def look(
        self, time: float, arm: Array, fingers: Array, state: State
    ) -> JointTrajectory:
        """Look at the scene, see `core.interfaces.Reactions`, and plan on by what is seen."""
        before = self._sightings
        seen = self._planned.perceive(time, arm, fingers, state, before)
        self._sightings = (*before, seen)
        asked = self._waypoints.looks[len(before)]
        report = self._planned.report(asked, self._sightings)
        self.looked = (*self.looked, report)

        stay = self._stay(time, arm)
        arrivals = self.motion.arrivals
        rest = self._plan_rest(stay, len(arrivals))
        self.motion = self._join_motions(stay, arrivals, rest)
        self._find_next(len(arrivals))

        return self.motion.trajectory

    def _stay(self, time: float, arm: Array) -> JointTrajectory:
        """Stay where the arm is while it is looked: where it is driven to, unless something holds it back."""
        trajectory = self.motion.trajectory
        look_s = self._settings.perception.look_s
        lag = float(np.abs(trajectory.arm[-1] - arm).max())

        if lag > self._settings.feel.stall:
            trajectory = bring_to_rest(
                trajectory, time, arm, self._arm, self._settings.speed
            )

        return trajectory.held(max(time + look_s - trajectory.duration, FEEL_S))

    def feel(
        self,
        time: float,
        arm: Array,
        points: Array,
        forces: Array,
    ) -> JointTrajectory | None:
        """Take a reading, see `core.interfaces.Reactions`.

        The steps stand in docs/physics_explained.md.
        """
        if self._number is None or self._watch is None:
            return None

        watch = self._watch
        guard = watch.guard
        force = self._sense.estimate(arm, points, forces)
        fired = watch.has_fired(self.motion.trajectory, time, arm, force)
        if not fired and time < self._until:
            near = time >= self._until - 2 * FEEL_S
            return self._extend(guard) if near else None

        what = guard.until if fired else ""
        newtons = float(np.linalg.norm(watch.force))
        self.felt += (Felt(self._number + 1, time, what, newtons),)
        self._poses += (self._arm.forward(arm) if fired else None,)

        if fired:
            return self._stop(time, self._number, arm)
        if guard.otherwise == "end":
            return self._stop(time, self._number)

        # Only where the way was too short for a reading before its end.
        extended = self._extend(guard)
        self._find_next(self._number + 1)
        return extended

    def _stop(
        self, time: float, number: int, arm: Array | None = None
    ) -> JointTrajectory:
        """Stop on the way to a waypoint, and plan the rest.

        Args:
            time: now.
            number: of the waypoint, from 0.
            arm: the joints to stop at; None: those that the arm is driven to, and the motion ends there.
        """
        before = self.motion
        stop = bring_to_rest(
            before.trajectory, time, arm, self._arm, self._settings.speed
        )
        wait_s = self._tempo.waits[number]

        if arm is None:
            self._ended = True
        elif wait_s > 0:
            stop = stop.held(wait_s)

        arrivals = np.append(before.arrivals[:number], stop.duration)
        rest = None if arm is None else self._plan_rest(stop, number + 1)
        self.motion = self._join_motions(stop, arrivals, rest)
        self._find_next(number + 1)

        return self.motion.trajectory

    def _extend(self, guard: Guard) -> JointTrajectory | None:
        """Plan on from the guard's waypoint just before it is reached, if the motion ends there and the plan does not.

        None: the motion stays.
        """
        motion = self.motion
        count = len(motion.arrivals)
        last = self._number == count - 1

        if not last or guard.otherwise == "end" or self.problem:
            return None

        rest = self._plan_rest(motion.trajectory, count)
        if rest is None:
            return None

        self.motion = self._join_motions(motion.trajectory, motion.arrivals, rest)
        return self.motion.trajectory

    def _join_motions(
        self, first: JointTrajectory, arrivals: Array, rest: Motion | None
    ) -> Motion:
        """Join the motion until now and the rest of it.

        Args:
            first: how the arm moved until now.
            arrivals: (K,) when the waypoints of that were reached, seconds.
            rest: what comes then; None: nothing.
        """
        count = len(arrivals)
        trajectory = first
        places = self._arm.positions(first.arm)
        distance = float(step_lengths(places).sum())
        misses = self.motion.misses[:count]
        slowed = self.motion.slowed[:count]

        if rest is not None:
            added = rest.trajectory
            trajectory = first.extended(
                added.times[1:], added.arm[1:], added.fingers[1:]
            )
            distance += rest.distance_m
            arrivals = np.append(arrivals, first.duration + rest.arrivals)
            misses = np.vstack([misses, rest.misses])
            slowed = np.append(slowed, rest.slowed)

        plan = self._waypoints.poses[: len(arrivals)]
        return Motion(
            trajectory,
            distance,
            arrivals,
            misses,
            plan,
            slowed,
        )

    def _plan_rest(self, stop: JointTrajectory, count: int) -> Motion | None:
        """Plan what comes after the first ``count`` waypoints until the next guard or look, from where the arm stopped.

        None: nothing comes, or it means nothing, takes too long or is too much work: the ``problem``.
        """
        known = not self.looks or len(self._waypoints.looks) > len(self._sightings)
        if known and count == len(self._waypoints):
            return None

        opening = self._arm.robot.opening_m
        grip = 1 - float(stop.fingers[-1]) / opening if opening else 0.0
        begin = Begin(stop.arm[-1], grip)

        try:
            self._waypoints = self._planned.resolve(self._poses, self._sightings)
            if count == len(self._waypoints):
                self._planned.check(stop, 0.0)
                return None

            rest = self._choose_rest(count)
            motion = self._planned.go_on(rest, begin)
            self._planned.check(motion.trajectory, stop.duration)
        except DesignError as error:
            self.problem = f"{self._describe_last(count)}: {error}"
            return None

        return motion

    def _describe_last(self, count: int) -> str:
        """Say what was known last, when the first ``count`` waypoints were reached."""
        if self.looked and self.looked[-1].waypoint == count:
            return f"after look {len(self.looked)}"
        return f"after the guard of waypoint {count}"

    def _choose_rest(self, count: int) -> Waypoints:
        """Choose the waypoints after the first ``count``, up to the next one with a guard, and their tempo."""
        waypoints = self._waypoints
        guarded = [k for k, guard in enumerate(waypoints.guards) if guard is not None]
        last = min((k for k in guarded if k >= count), default=len(waypoints) - 1)
        rest = slice(count, last + 1)
        parts = {name: array[rest] for name, array in vars(self._tempo).items()}

        return Waypoints(waypoints.poses[rest], Tempo(**parts))

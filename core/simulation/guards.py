"""Play motions that feel: where a guard fires the arm stops, and the way to the next guard is planned from there.

The whole motion is planned at first, as if no guard fired, so that a plan can be refused before it is tried.

A guard reads what an arm with torque sensors reports: the force at its flange, estimated from its joints' torques. The
engine gives the contact forces. The arm's Jacobian makes joint torques of them, and each torque gets the sensor's
noise. Least squares make a force of the torques again, so that an arm near a singularity estimates badly. Weight and
inertia are taken as known. The first reading of a guarded way counts as zero. Of three readings in a row the middle one
counts, so that one peak of an impact does not fire a guard.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from core.design import DesignError
from core.designs.planning import resolve
from core.geometry import Array, Pose
from core.interfaces import (
    ActionPlan,
    Felt,
    Guard,
    JointTrajectory,
    RolloutSettings,
    Task,
    Waypoints,
)
from core.robot.kinematics import Arm, arm_of
from core.robot.tempo import plan_task_motion
from core.robot.trajectory import Begin, Motion
from core.scene import Scene
from core.values.jobs import FEEL_S

_NOISE = 9  # keeps these random numbers apart from others of the same seed
_DAMPING = 1e-6  # as a share of the Jacobian's square, so that estimates stay finite at a singularity
_MEDIAN = 3  # readings
_LONGER = 1.2  # times as long, while stopping needs more acceleration than a joint has
_STILL_M = 1e-6  # the mount moves by less between two readings: no direction


class PlannedGuards:
    """The guards of one candidate's plan in one layout, see `core.interfaces.Guards`. ``scene`` is its layout.

    Attributes:
        motion: as it is planned now; after a rollout, as it was played.
        felt: how its guards ended so far.
        problem: why the rest could not be planned; the motion ended there.
    """

    def __init__(
        self,
        plan: ActionPlan,
        waypoints: Waypoints,
        motion: Motion,
        task: Task,
        seed: int,
        settings: RolloutSettings,
        scene: Scene | None = None,
    ) -> None:
        self._plan, self._task, self._seed, self._settings, self._scene = (
            plan,
            task,
            seed,
            settings,
            scene,
        )
        self._planned, self._arm = (waypoints, motion), arm_of(task.robot)
        self.begin()

    def begin(self) -> JointTrajectory:
        """See `core.interfaces.Guards`."""
        self._waypoints, self.motion = self._planned
        self.felt: tuple[Felt, ...] = ()
        self.problem: str | None = None
        self._poses: tuple[Pose | None, ...] = ()
        self._sensed: list[Array] = []
        self._random = np.random.default_rng([self._seed, _NOISE])
        self._next()
        return self.motion.trajectory

    def _next(self) -> None:
        """Find the next guard: its waypoint, and the time of its way."""
        after = self.felt[-1].waypoint if self.felt else 0
        guards = self._waypoints.guards[: len(self.motion.arrivals)]
        self._at = next(
            (k for k, guard in enumerate(guards) if guard is not None and k >= after),
            None,
        )
        self._sensed = []
        self.since, self._until = math.inf, math.inf
        if self._at is not None:
            arrivals, tempo = self.motion.arrivals, self._waypoints.tempo
            waits = np.zeros(len(guards)) if tempo is None else tempo.waits
            self.since = (
                float(arrivals[self._at - 1] + waits[self._at - 1]) if self._at else 0.0
            )
            self._until = float(arrivals[self._at] + waits[self._at])

    def feel(
        self, time: float, arm: Array, points: Array, forces: Array
    ) -> JointTrajectory | None:
        """See `core.interfaces.Guards`."""
        if self._at is None:
            return None
        guard = self._waypoints.guards[self._at]
        assert guard is not None
        self._sensed.append(self._estimate(arm, points, forces))
        force = (
            np.sort(self._sensed[-_MEDIAN:], axis=0)[len(self._sensed[-_MEDIAN:]) // 2]
            - self._sensed[0]
        )
        fired = self._fires(guard, time, arm, force)
        if not fired and time < self._until:
            return self._extended(time, guard)
        self.felt += (
            Felt(
                self._at + 1,
                time,
                guard.until if fired else "",
                float(np.linalg.norm(force)),
            ),
        )
        self._poses += (self._arm.forward(arm) if fired else None,)
        if fired or guard.otherwise == "end":
            return self._go_on(time, arm if fired else None, self._at)
        extended = self._extended(
            time, guard
        )  # only where the way was too short for a reading before its end
        self._next()
        return extended

    def _estimate(self, arm: Array, points: Array, forces: Array) -> Array:
        """Estimate the force at the flange (3,) from the joints' torques."""
        jacobian = self._arm.jacobian(arm)
        torques = self._settings.feel.noise * self._random.standard_normal(len(arm))
        if len(forces):
            turning = (points - self._arm.positions(arm[None])).T @ forces
            moment = [
                turning[i, j] - turning[j, i] for i, j in ((1, 2), (2, 0), (0, 1))
            ]  # the sum of cross products
            torques += jacobian.T @ np.concatenate([forces.sum(axis=0), moment])
        square = jacobian @ jacobian.T
        square.flat[::7] += _DAMPING * np.trace(square)
        return np.asarray(
            np.linalg.solve(square, jacobian @ torques)[:3], dtype=np.float64
        )

    def _fires(self, guard: Guard, time: float, arm: Array, force: Array) -> bool:
        if guard.until == "touch":
            return float(np.linalg.norm(force)) > self._settings.feel.threshold
        targets, _ = self.motion.trajectory.sample(np.array([time - FEEL_S, time]))
        if guard.until == "stall":
            return float(np.abs(targets[1] - arm).max()) > self._settings.feel.stall
        before, now = self._arm.positions(targets)
        way = float(np.linalg.norm(now - before))
        return way > _STILL_M and float(force @ (before - now)) / way > guard.newtons

    def _go_on(self, time: float, arm: Array | None, at: int) -> JointTrajectory:
        """Stop at joints ``arm``, on the way to waypoint ``at`` (from 0), and plan the rest; None: end the motion."""
        begun, tempo, count = self.motion, self._waypoints.tempo, at + 1
        stop = _stopped(begun.trajectory, time, arm, self._arm, self._settings.speed)
        if arm is not None and tempo is not None and tempo.waits[at] > 0:
            times = np.array([0.0, tempo.waits[at]])
            stop = _then(
                stop, JointTrajectory(times, stop.arm[[-1, -1]], stop.fingers[[-1, -1]])
            )
        arrivals = np.append(begun.arrivals[:at], stop.duration)
        self.motion = self._joined(
            stop, arrivals, self._rest(stop, count) if arm is not None else None
        )
        self._next()
        return self.motion.trajectory

    def _extended(self, time: float, guard: Guard) -> JointTrajectory | None:
        """Plan on from the guard's waypoint just before it is reached, if the motion ends there and the plan does not.

        None: the motion stays.
        """
        motion = self.motion
        count, ends = len(motion.arrivals), guard.otherwise == "end"
        if (
            time < self._until - 2 * FEEL_S
            or self._at != count - 1
            or ends
            or self.problem
        ):
            return None
        rest = self._rest(motion.trajectory, count)
        if rest is None:
            return None
        self.motion = self._joined(motion.trajectory, motion.arrivals, rest)
        return self.motion.trajectory

    def _joined(
        self, first: JointTrajectory, arrivals: Array, rest: Motion | None
    ) -> Motion:
        """Join the motion until now, with its waypoints' ``arrivals`` (K,), and the rest of it."""
        count, distance = len(arrivals), _way(first, self._arm)
        misses, slowed = self.motion.misses[:count], self.motion.slowed[:count]
        if rest is not None:
            arrivals = np.append(arrivals, first.duration + rest.arrivals)
            first, distance = _then(first, rest.trajectory), distance + rest.distance_m
            misses, slowed = (
                np.vstack([misses, rest.misses]),
                np.append(slowed, rest.slowed),
            )
        plan, worst = self._waypoints.poses[: len(arrivals)], misses.max(axis=0)
        return Motion(
            first,
            distance,
            float(worst[0]),
            float(worst[1]),
            arrivals,
            misses,
            plan,
            slowed,
        )

    def _rest(self, stop: JointTrajectory, count: int) -> Motion | None:
        """Plan what comes after the first ``count`` waypoints until the next guard, from where the arm stopped.

        None: nothing comes, or there is a ``problem``, which is kept.
        """
        if count == len(self._waypoints):
            return None
        try:
            return self._planned_on(stop, count)
        except DesignError as error:
            self.problem = f"after the guard of waypoint {count}: {error}"
            return None

    def _planned_on(self, stop: JointTrajectory, count: int) -> Motion:
        """See `_rest`.

        Raises:
            DesignError: it means nothing, or takes too long.
        """
        waypoints = resolve(
            self._plan, self._task, self._seed, self._settings, self._scene, self._poses
        )
        self._waypoints = waypoints
        guards = waypoints.guards
        own = slice(
            count,
            next(
                (k for k in range(count, len(guards)) if guards[k]), len(waypoints) - 1
            )
            + 1,
        )
        tempo = waypoints.tempo
        if tempo is not None:
            tempo = replace(
                tempo, **{name: array[own] for name, array in vars(tempo).items()}
            )
        opening = self._arm.robot.opening_m
        grip = 1 - float(stop.fingers[-1]) / opening if opening else 0.0
        rest = Waypoints(waypoints.poses[own], tempo)
        motion = plan_task_motion(
            rest, self._task, self._settings, Begin(stop.arm[-1], grip)
        )
        took, most = (
            stop.duration + motion.trajectory.duration,
            self._settings.max_motion_s,
        )
        if took > most:
            raise DesignError(f"the motion takes {took:.0f} s, more than {most:.0f} s")
        return motion


def _stopped(
    trajectory: JointTrajectory, time: float, end: Array | None, arm: Arm, speed: float
) -> JointTrajectory:
    """Cut a trajectory at ``time``, and come to rest at joints (J,) that are near, or where the targets are.

    Each joint's course is the cubic between the two; it takes as long as the acceleration limits ask for.
    """
    targets, fingers = trajectory.sample(np.array([time - FEEL_S, time]))
    begin, velocity = targets[1], (targets[1] - targets[0]) / FEEL_S
    way, limits, lasts = (
        (begin if end is None else end) - begin,
        speed * arm.acceleration_limits,
        FEEL_S,
    )
    while (
        np.abs([6 * way / lasts - 4 * velocity, 2 * velocity - 6 * way / lasts])
        > limits * lasts
    ).any():
        lasts *= _LONGER
    since = np.linspace(0.0, 1.0, max(1, math.ceil(lasts / FEEL_S)) + 1)[1:, None]
    course = (
        begin
        + lasts * velocity * since * (1 - since) ** 2
        + way * since**2 * (3 - 2 * since)
    )
    before = trajectory.times < time
    return JointTrajectory(
        np.concatenate([trajectory.times[before], [time], time + lasts * since[:, 0]]),
        np.vstack(
            [trajectory.arm[before], targets[1:], np.clip(course, arm.lower, arm.upper)]
        ),
        np.concatenate(
            [trajectory.fingers[before], np.full(1 + len(since), fingers[1])]
        ),
    )


def _then(one: JointTrajectory, other: JointTrajectory) -> JointTrajectory:
    """Join two trajectories; the second begins where the first ends."""
    times = one.duration + other.times[1:]
    return JointTrajectory(
        np.append(one.times, times),
        np.vstack([one.arm, other.arm[1:]]),
        np.append(one.fingers, other.fingers[1:]),
    )


def _way(trajectory: JointTrajectory, arm: Arm) -> float:
    """The length of the mount's way, metres."""
    places = arm.positions(trajectory.arm)
    return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())

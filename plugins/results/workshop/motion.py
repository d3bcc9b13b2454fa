"""Sample a motion at a fixed rate for a real arm, smooth and within its limits, and play it in an engine.

Engines play joint targets that are linear between instants 10 ms apart. An arm that interpolates so at 1 kHz breaks its
acceleration limits several times over. Here the targets are the control points of a cubic B-spline. Its accelerations
are means of those of the targets, so that it keeps the limits without taking longer: what is struck or thrown flies as
it was simulated. A spline through the targets swings about them, and had to be up to 15 % slower.
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import BSpline

from core.design import Tool
from core.errors import UsageError, UserError
from core.geometry import Array
from core.interfaces import (
    JointTrajectory,
    Recording,
    Rollout,
    RolloutSettings,
    Simulator,
    Task,
)
from core.robot.kinematics import Arm
from core.scene import Scene, State
from core.solids.contacts import Contacts, find_contacts, make_trace
from core.solids.penetration import findings
from core.task import reward_of

SHARE = 0.97  # of the velocity and acceleration limits, at most
APPROACH = (
    0.1  # of the velocity limits, at most: the first motion from where the arm stands
)
STEP_S = 0.01  # between two knots of the spline; by so much it is behind the targets, as it begins at rest


RECORD_HZ = 100.0


@dataclass(frozen=True, eq=False)
class Sampled:
    """A motion at a fixed rate.

    Attributes:
        times: (T,) seconds, from 0.
        positions: (T, J) of the arm's joints, radians; with ``velocities`` and ``accelerations``.
        fingers: (T,) each finger's distance from the middle, metres.
        slower: how many times longer it takes than the motion that was simulated.
    """

    times: Array
    positions: Array
    velocities: Array
    accelerations: Array
    fingers: Array
    slower: float = 1.0

    @property
    def trajectory(self) -> JointTrajectory:
        """The motion as engines play it."""
        return JointTrajectory(self.times, self.positions, self.fingers)

    def every(self, seconds: float) -> list[int]:
        """Return the samples nearest to multiples of ``seconds``, and the last."""
        wanted = np.append(np.arange(0.0, self.times[-1], seconds), self.times[-1])
        chosen: list[int] = np.unique(
            np.searchsorted(self.times, wanted - 1e-9)
        ).tolist()
        return chosen

    def loads(self, arm: Arm) -> tuple[Array, Array]:
        """Return the largest share of each joint's velocity limit and of its acceleration limit: each (J,)."""
        velocity = np.abs(self.velocities).max(axis=0) / arm.velocity_limits
        return velocity, np.abs(self.accelerations).max(
            axis=0
        ) / arm.acceleration_limits


def sample(
    trajectory: JointTrajectory, arm: Arm, rate_hz: float, speed: float = 1.0
) -> Sampled:
    """Sample a trajectory at ``rate_hz``; it takes 1 / ``speed`` times as long, or longer where a limit asks for it.

    Raises:
        UsageError: the rate or the speed can't be used.
    """
    if not 10 <= rate_hz <= 10_000:
        raise UsageError(f"rate must be between 10 and 10000 Hz, got {rate_hz}")
    if not 0 < speed <= 1:
        raise UsageError(f"speed must be above 0 and at most 1, got {speed}")
    steps = math.ceil(trajectory.duration / STEP_S - 1e-9) + 2
    instants = STEP_S * np.arange(
        -2, steps + 1, dtype=np.float64
    )  # it waits for two steps at both ends
    targets, _ = trajectory.sample(instants)
    path = BSpline(STEP_S * np.arange(-3, steps + 4), targets, 3)
    fine = STEP_S / 5 * np.arange(5 * steps + 1)
    fastest = (np.abs(path(fine, 1)) / arm.velocity_limits).max() / SHARE
    hardest = (np.abs(path(fine, 2)) / arm.acceleration_limits).max() / SHARE
    slower = max(1.0 / speed, float(fastest), math.sqrt(hardest))
    times = np.arange(math.ceil(STEP_S * steps * slower * rate_hz - 1e-6) + 1) / rate_hz
    own = np.minimum(times / slower, STEP_S * steps)
    velocities, accelerations = (path(own, order) / slower**order for order in (1, 2))
    _, fingers = trajectory.sample(own - STEP_S)
    return Sampled(
        times,
        np.clip(path(own), arm.lower, arm.upper),
        velocities,
        accelerations,
        fingers,
        slower,
    )


def approach(
    start: Array, end: Array, opening: float, arm: Arm, rate_hz: float
) -> Sampled:
    """Move slowly from joints (J,) to others, all joints in step, at rest at both ends.

    The course is the polynomial of fifth degree without acceleration at the ends.

    Raises:
        UsageError: the start is beyond a joint's limit.
    """
    if (
        start.shape != end.shape
        or ((start < arm.lower - 1e-6) | (start > arm.upper + 1e-6)).any()
    ):
        limits = ", ".join(
            f"{low:.2f} to {high:.2f}"
            for low, high in zip(arm.lower, arm.upper, strict=True)
        )
        raise UsageError(
            f"from must be {len(end)} joint angles in radians within {limits}; got {start.tolist()}"
        )
    way = end - start
    duration = max(
        float((1.875 * np.abs(way) / (APPROACH * arm.velocity_limits)).max()),
        1 / rate_hz,
    )
    times = np.arange(math.ceil(duration * rate_hz) + 1) / rate_hz
    s = np.minimum(times / duration, 1.0)[:, None]
    positions = start + way * s**3 * (10 - 15 * s + 6 * s**2)
    velocities = way * 30 * s**2 * (1 - s) ** 2 / duration
    accelerations = way * 60 * s * (1 - s) * (1 - 2 * s) / duration**2
    return Sampled(
        times, positions, velocities, accelerations, np.full(len(times), opening)
    )


def cut(
    trajectory: JointTrajectory, arrivals: Array, instant: float, arm: Arm
) -> JointTrajectory | None:
    """Return the part up to the last waypoint before an instant where the arm rests; None if there is none."""
    for end in sorted((float(at) for at in arrivals if at < instant), reverse=True):
        joints, fingers = trajectory.sample(end + STEP_S * np.array([-1.0, 0.0, 1.0]))
        if (
            np.abs(np.diff(joints, axis=0)) <= arm.acceleration_limits * STEP_S**2
        ).all():
            before = trajectory.times < end - 1e-9
            times = np.append(trajectory.times[before], end)
            opening = np.append(trajectory.fingers[before], fingers[1])
            return JointTrajectory(
                times, np.vstack([trajectory.arm[before], joints[1]]), opening
            )
    return None


def to_csv(motion: Sampled, joints: tuple[str, ...]) -> str:
    """Write a row for each sample: time, then positions, velocities and accelerations, and the fingers."""
    text = io.StringIO()
    columns = [
        f"{name}_{kind}" for kind in ("rad", "rad_s", "rad_s2") for name in joints
    ]
    table = np.column_stack(
        [
            motion.times,
            motion.positions,
            motion.velocities,
            motion.accelerations,
            motion.fingers,
        ]
    )
    header = ",".join(["time_s", *columns, "finger_m"])
    np.savetxt(text, table, fmt="%.7g", delimiter=",", header=header, comments="")
    return text.getvalue()


def to_json(motion: Sampled, joints: tuple[str, ...]) -> Mapping[str, Any]:
    """Return the same as data."""
    arrays = ("times", "positions", "velocities", "accelerations", "fingers")
    return {
        "joints": list(joints),
        **{name: np.round(getattr(motion, name), 7).tolist() for name in arrays},
    }


class Unplayable(UserError):
    """The rollout of an exported motion failed."""


@dataclass(frozen=True, eq=False)
class PlayedMotion:
    """What a motion earned in an engine, and what was seen; ``problems`` name what passed through something."""

    reward: float
    recording: Recording
    contacts: Contacts
    problems: tuple[str, ...]


def play(
    task: Task,
    simulator: Simulator,
    tool: Tool,
    motion: Sampled,
    scene: Scene,
    seed: int,
    settings: RolloutSettings,
) -> PlayedMotion:
    """Play a motion from its first sample, in the layout of ``seed``.

    Raises:
        Unplayable: the rollout fails.
    """
    hold = max(settings.hold_s, task.hold_s)
    job = Rollout(
        tool, motion.trajectory, seed, settings.settle_s, hold, RECORD_HZ, forces=True
    )
    (outcome,) = simulator.rollout(task, [job])
    if (
        outcome.error is not None
        or outcome.start is None
        or outcome.end is None
        or outcome.recording is None
    ):
        raise Unplayable(
            f"the exported motion can't be played: {outcome.error or 'the engine returned no recording'}"
        )
    start, end = (
        scene.complete(State.stack([state])) for state in (outcome.start, outcome.end)
    )
    contacts = find_contacts(scene, task.robot, tool, outcome.recording)
    trace = make_trace(scene, [contacts]) if task.reads_trace else None
    reward = float(np.asarray(reward_of(task, start, end, trace))[0])
    seen = findings(scene, task.robot, tool, outcome.recording)
    problems = tuple(finding.text for finding in seen if finding.penetration)
    return PlayedMotion(
        0.0 if problems else reward, outcome.recording, contacts, problems
    )

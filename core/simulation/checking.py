"""Say what is wrong with a design without playing it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from core.design import Candidate
from core.interfaces import Recording
from core.robot.kinematics import finger_values
from core.scene import State
from core.simulation.attempt import Attempt, Stage, plan_attempt, stage_of
from core.solids.contacts import find_contacts
from core.trial import Condition
from core.values.observations import MISSED_M, MISSED_RAD
from core.values.traces import TRACE_HZ


def find_problems(condition: Condition, candidate: Candidate) -> list[str]:
    """Say what is wrong with a candidate in a condition, without playing it.

    That is why it would be rejected, or else which waypoints the arm misses or is late at, how far it stays from all
    that can move, and where it meets itself.

    Args:
        condition: where it would be played.
        candidate: the tool and its plan.
    """
    stage = stage_of(condition)
    planned = plan_attempt(stage, candidate)
    if planned.trial is not None:
        return [planned.trial.reason]

    motion = planned.motion
    problems = []

    for waypoint, (metres, radians) in enumerate(motion.misses.tolist(), start=1):
        if metres > MISSED_M or radians > MISSED_RAD:
            miss = f"{1000 * metres:.0f} mm, {radians:.2f} rad"
            problems.append(f"the arm misses the way to waypoint {waypoint} by {miss}")

    problems += _find_untouched(stage, planned)
    return [*problems, *motion.slowdowns(), *planned.warnings]


def _find_untouched(stage: Stage, planned: Attempt) -> Iterator[str]:
    """Say how near the robot would come to what can move, if as planned it touches none of it.

    Where bodies move by themselves, or guards and looks change the motion, that is not known before it is played.

    Args:
        stage: the condition.
        planned: a candidate whose motion is planned.
    """
    job = planned.job
    scene = planned.scene
    movable = {body.name for body in scene.bodies if not body.fixed}
    driven = any(joint.drive for joint in scene.joints)
    if driven or job.reactions or any(body.launched for body in scene.bodies):
        return

    duration = job.trajectory.duration
    times = np.linspace(0.0, duration, 2 + int(duration * TRACE_HZ))
    arm, opening = job.trajectory.sample(times)
    robot = stage.task.robot
    fingers = finger_values(robot, job.tool, opening)
    still = State.stack([scene.state()] * len(times))
    contacts = find_contacts(
        scene, robot, job.tool, Recording(times, arm, fingers, still)
    )

    touched = {other for kind, _, other in contacts.touching if kind != "body"}
    gaps = {name: near.gap_m for name, near in contacts.approaches.items()}
    missed = movable & gaps.keys()
    if missed and not touched & movable:
        name = min(sorted(missed), key=gaps.__getitem__)
        gap = f"{1000 * gaps[name]:.0f} mm"
        yield f"as planned, the robot touches nothing that can move: it comes no nearer than {gap} to {name}"

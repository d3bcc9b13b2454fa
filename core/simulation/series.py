"""Play a candidate once more, and read what changes over time: ways to the goals, and what the robot presses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from core.design import Candidate, DesignError
from core.geometry import Array
from core.goals import reaches
from core.interfaces import Ability
from core.scene import Scene
from core.simulation.attempt import plan_attempt, stage_of
from core.solids.contacts import find_contacts, make_trace
from core.solids.record_rate import is_finite
from core.task import Task
from core.trial import Condition
from core.values.traces import Trace

_HZ = 100.0  # of the recording; a force is the mean between two samples
_PRESSED = 4  # bodies whose forces are read, those that are pressed hardest
_WANTED = 4  # bodies of a goal that are read


@dataclass(frozen=True, eq=False)
class Series:
    """A figure over time.

    Attributes:
        name: what it is.
        unit: of its values.
        times: (T,) seconds of the motion.
        values: (T,).
    """

    name: str
    unit: str
    times: Array
    values: Array


def read_series(condition: Condition, candidate: Candidate) -> list[Series]:
    """Play a candidate in a condition, and return how far each goal's bodies are from where they are wanted, and what
    the robot presses, over time.

    Raises:
        DesignError: it would be rejected, or fails; says why.
    """
    stage = stage_of(condition)
    planned = plan_attempt(stage, candidate)
    if planned.trial is not None:
        raise DesignError(planned.trial.reason)

    simulator = stage.simulator
    job = replace(
        planned.job,
        record_hz=max(planned.job.record_hz, _HZ),
        forces=Ability.FORCES in simulator.supports,
    )
    (outcome,) = simulator.rollout(stage.task, [job])
    recording = outcome.recording
    if recording is None or not is_finite(recording):
        raise DesignError(outcome.error or "the engine returned no recording")

    scene = planned.scene
    contacts = find_contacts(scene, stage.task.robot, job.tool, recording)
    trace = make_trace(scene, contacts)
    return [*_read_ways(stage.task, trace), *_read_forces(scene, trace)]


def _read_ways(task: Task, trace: Trace) -> Iterator[Series]:
    """Read what is left of the way to each goal."""
    start = trace.states[0]
    for goal in reaches(task.goals):
        for body in goal.subjects(start)[:_WANTED]:
            for measure in goal.all_measures(body, start):
                left = measure.left(trace.states)
                yield Series(f"{measure.name}, left", measure.unit, trace.times, left)


def _read_forces(scene: Scene, trace: Trace) -> list[Series]:
    """Read how hard the robot presses the bodies that it presses hardest, each from one instant to the next."""
    if trace.forces is None:
        return []

    found = []
    for body in scene.bodies:
        pressed = trace.forces_n(body.name, "robot")
        if pressed.max(initial=0.0) > 0:
            found.append(Series(f"force on {body.name}", "N", trace.times, pressed))
    found.sort(key=lambda series: (-float(series.values.max()), series.name))
    return found[:_PRESSED]

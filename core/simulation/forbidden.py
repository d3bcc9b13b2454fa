"""Find what a rollout did that the goals of its task forbid: a touch, too large a force, a body that does not stay.

Covered by `tests/core/simulation/test_observing.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from core.goals import KEPT_M
from core.interfaces import Task
from core.scene import Goal, Scene, State
from core.solids.contacts import Contacts, make_trace
from core.values.observations import Class
from core.values.traces import Trace

MARGINAL = 0.25  # of what a body to keep may move; a task's own limit may be lower than that of its goal

Cause = tuple[float, Class, str]  # when, what, and to which body


def find_forbidden(task: Task, scene: Scene, contacts: Contacts, start: State, end: State) -> Iterator[Cause]:
    """Yield what the goals forbid and the rollout did, with the numbers."""
    names = {body.name for body in scene.bodies}
    goals = [goal for goal in task.goals if goal.untouched or goal.keep]
    if not goals:
        return
    trace = make_trace(scene, [contacts])[0]
    for goal in goals:
        yield from _touched(goal, [name for name in goal.untouched if name in names], contacts, trace)
    for goal in goals:
        yield from _moved(goal, start, end, trace)


def _touched(goal: Goal, names: Iterable[str], contacts: Contacts, trace: Trace) -> Iterator[Cause]:
    for name in names:
        if goal.max_force_n > 0:
            forces = trace.forces_n(name, "robot") if trace.forces is not None else np.zeros(len(trace.times))
            if (over := forces > goal.max_force_n).any():
                said = f"{name} pressed with {forces.max():.0f} N, {goal.max_force_n:g} N allowed"
                yield float(trace.times[over.argmax()]), "forbidden", said
        elif (flags := trace.contact(name, "robot")).any():
            by = [c for c in contacts.all if c.kind != "body" and c.other == name]
            first = min(by, key=lambda contact: contact.first_s).one if by else "the robot"
            yield float(trace.times[flags.argmax()]), "forbidden", f"{first} touched {name}"


def _moved(goal: Goal, start: State, end: State, trace: Trace) -> Iterator[Cause]:
    for name in goal.keep:
        if name not in start.names:
            continue
        way = float(np.linalg.norm(end.position(name) - start.position(name)))
        if way > MARGINAL * KEPT_M:
            ways = np.linalg.norm(trace.states.position(name) - start.position(name), axis=-1)
            begun = float(trace.times[(ways > MARGINAL * KEPT_M).argmax()])
            yield begun, "forbidden", f"{name} moved by {1000 * way:.0f} mm, and is to stay"

"""Say what is wrong with a design without playing it."""

from __future__ import annotations

from collections.abc import Iterator

from core.design import Candidate, DesignError
from core.simulation.rehearsing import Rehearsal, rehearse
from core.trial import Condition
from core.values.observations import MISSED_M, MISSED_RAD


def find_problems(condition: Condition, candidate: Candidate) -> list[str]:
    """Say what is wrong with a candidate in a condition, without playing it.

    That is why it would be rejected, or else which waypoints the arm misses or is late at, what fixed or forbidden
    thing the robot meets on its way, how far it stays from all that can move, and where it meets itself.

    Args:
        condition: where it would be played.
        candidate: the tool and its plan.
    """
    try:
        rehearsal = rehearse(condition, candidate)
    except DesignError as error:
        return [str(error)]

    motion = rehearsal.motion
    problems = []

    for waypoint, (metres, radians) in enumerate(motion.misses.tolist(), start=1):
        if metres > MISSED_M or radians > MISSED_RAD:
            miss = f"{1000 * metres:.0f} mm, {radians:.2f} rad"
            problems.append(f"the arm misses the way to waypoint {waypoint} by {miss}")

    problems += _find_met(rehearsal)
    problems += _find_untouched(rehearsal)
    return [*problems, *motion.slowdowns(), *rehearsal.planned.warnings]


def _find_met(rehearsal: Rehearsal) -> Iterator[str]:
    """Say what fixed or forbidden thing the robot meets as planned, on the way to which waypoint."""
    for meeting in rehearsal.find_meetings():
        waypoint = rehearsal.find_waypoint(meeting.time_s)
        when = f"{meeting.time_s:.2f} s, on the way to waypoint {waypoint}"
        yield f"as planned, {meeting.text} at {when}"


def _find_untouched(rehearsal: Rehearsal) -> Iterator[str]:
    """Say how near the robot would come to what can move, if as planned it touches none of it.

    Where bodies move by themselves, or guards and looks change the motion, that is not known before it is played.
    """
    if not rehearsal.is_certain:
        return

    scene = rehearsal.planned.scene
    movable = {body.name for body in scene.bodies if not body.fixed}
    contacts = rehearsal.contacts
    touched = {other for kind, _, other in contacts.touching if kind != "body"}
    gaps = {name: near.gap_m for name, near in contacts.approaches.items()}
    missed = movable & gaps.keys()
    if missed and not touched & movable:
        name = min(sorted(missed), key=gaps.__getitem__)
        gap = f"{1000 * gaps[name]:.0f} mm"
        yield f"as planned, the robot touches nothing that can move: it comes no nearer than {gap} to {name}"

"""Say what a task's goals want of bodies in a layout: the only module that reads goals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from core.geometry import Array
from core.goals import Reach, needs_fixture, reaches
from core.interfaces import Task
from core.scene import Scene
from core.values.joints import PlacedJoint


@dataclass(frozen=True, eq=False)
class Want:
    """What a goal wants of bodies that are moved together.

    Attributes:
        goal: its number among the task's goals.
        bodies: their names.
        place: of a body's frame in the world, (3,), nan where it is free; None: anywhere.
        away: how far they are to get from where they are, metres.
        joint: that is to be moved ``to`` a position, m or rad.
        to: see ``joint``.
        reference: the body or mark by which the place is given.
        held: whether they end in hand.
        released: whether they end let go.
        rest: whether they end at rest.
        others: what it asks beyond that, in words, such as ``angle of cup``.
    """

    goal: int
    bodies: tuple[str, ...]
    place: Array | None = None
    away: float = 0.0
    joint: PlacedJoint | None = None
    to: float = 0.0
    reference: str = ""
    held: bool = False
    released: bool = False
    rest: bool = False
    others: tuple[str, ...] = ()


def list_wants(task: Task, scene: Scene) -> list[tuple[Want, ...]]:
    """List the alternatives that a task leaves, each of wants that are fulfilled one after another.

    Where one goal, or one body of it, is enough, each is an alternative. A task without goals wants nothing.

    Args:
        task: whose goals are read.
        scene: the layout.
    """
    goals = reaches(task.goals)
    options = [
        list(_read_goal(goal, task.goals.index(goal), scene)) for goal in goals
    ]
    if task.every and options:
        # Of what is left open in a goal, the first will do.
        return [tuple(want for option in options for want in option[0])]

    return [wants for option in options for wants in option]


def list_open(task: Task, scene: Scene) -> list[str]:
    """Name what the goals ask that no want says, such as a time limit; see `Want.others` for the rest."""
    goals = reaches(task.goals)
    asked = {
        "a time limit": any(goal.by_s is not None for goal in goals),
        "a fixture": any(needs_fixture(goal) for goal in task.goals),
        "what a soft body does as it gives way": bool(scene.softs),
    }
    return [what for what, is_asked in asked.items() if is_asked]


def _read_goal(goal: Reach, number: int, scene: Scene) -> Iterator[tuple[Want, ...]]:
    """Yield the alternatives of a goal: the wants of one body each, or those of all."""
    wants = [_read_body(goal, number, body, scene) for body in goal.subjects(scene.state())]
    if goal.any:
        for want in wants:
            yield (want,)
        return

    places = [want.place for want in wants]
    same = all(_is_same(place, places[0]) for place in places)
    if same and wants:
        yield (replace(wants[0], bodies=tuple(want.bodies[0] for want in wants)),)
    elif wants:
        yield tuple(wants)


def _read_body(goal: Reach, number: int, body: str, scene: Scene) -> Want:
    """Read what a goal and its parts want of one body."""
    start = scene.state()
    want = Want(
        number,
        (body,),
        held=goal.held,
        released=goal.released,
        rest=goal.rest,
    )

    for part in goal.parts:
        place = part.place_of(body, start)
        away = getattr(part, "away", None)
        joint = getattr(part, "joint", None)
        reference = getattr(part, "at", None) or ""

        if joint is not None and place is not None:
            to = float(part.aim(start))  # type: ignore[attr-defined]
            want = replace(want, joint=scene.placed_joints[joint], to=to)
        elif place is not None:
            want = replace(want, place=place, reference=reference)
        elif away is not None:
            want = replace(want, away=away)
        else:
            names = [measure.name for measure in part.measures(body, start)]
            want = replace(want, others=(*want.others, *names))

    return want


def _is_same(place: Array | None, other: Array | None) -> bool:
    """Report whether two places are the same."""
    if place is None or other is None:
        return place is other
    return np.array_equal(place, other, equal_nan=True)

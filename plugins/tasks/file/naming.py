"""Give the goals of a scene file the names and hollows of its scene."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

import numpy as np

from core.errors import UsageError, choices
from core.goals import (
    NAMED,
    Apart,
    Facing,
    Flattened,
    Goal,
    Inside,
    Kept,
    Reach,
    Space,
    Spread,
    Throughout,
    Turned,
    TurnedBy,
    Untouched,
    check_names,
    list_names,
    needs_fixture,
    reaches,
)
from core.scene import FIXTURE, Body, Scene, Soft
from plugins.tasks.file.body_building import build_mark
from plugins.tasks.file.contacts import CONTACT_M, find_gaps
from plugins.tasks.file.doubts import find_foot
from plugins.tasks.file.goals import Entry, join_entries
from plugins.tasks.file.hollows import FixtureHollow, find_hollow, space_of
from plugins.tasks.file.spec import MarkSpec, SceneSpec
from plugins.tasks.file.tree import Tree
from plugins.tasks.file.vain_goals import check_meetable, find_circle, find_conflicts

_GLOB = re.compile(r"[*?\[]")
_IS = ("is", "are")


def find_names(patterns: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    """Return the names that patterns such as ``grain*`` fit, in order; what is no pattern is taken as it is.

    Raises:
        UsageError: a pattern fits none.
    """
    found = dict[str, None]()
    for pattern in patterns:
        fitting = [pattern]
        if _GLOB.search(pattern):
            fitting = [name for name in names if fnmatchcase(name, pattern)]
        if not fitting:
            raise choices("name like", pattern, names)

        found |= dict.fromkeys(fitting)

    return tuple(found)


def build_goals(tree: Tree, spec: SceneSpec, scene: Scene) -> tuple[Goal, ...]:
    """Build the goals of all entries, with the names and hollows of a scene.

    Raises:
        UserError: one names what is not there, or asks what can't be.
    """
    names = set[str | int]()  # of goals that another may come after
    for number, entry in enumerate(spec.goals):
        for reach in reaches(entry):
            names |= {number, reach.name or number}

    marks = {mark.name: mark for mark in spec.marks}
    entries = []
    for number, entry in enumerate(spec.goals):
        try:
            entries.append(tuple(_resolve(goal, scene, marks) for goal in entry))
            for reach in reaches(entry):
                if reach.after is not None and reach.after not in names:
                    problem = choices("goal", str(reach.after), map(str, names))
                    raise tree.error(("goals", number, "after"), str(problem))
        except (UsageError, ValueError) as error:
            raise tree.error(("goals", number), str(error)) from None

    _check_together(tree, entries, scene)
    goals = join_entries(entries)
    if not reaches(goals):
        raise tree.error(
            ("goals",),
            "they only say what must not happen (keep, untouched, throughout), so nothing can be earned; add what is "
            "to be reached, such as {bodies: [cup], raised: 0.1}",
        )

    return goals


def _check_together(tree: Tree, entries: Sequence[Entry], scene: Scene) -> None:
    """Refuse entries that can't be met together.

    Raises:
        UserError: says which, and why.
    """
    numbered = [
        (number, goal) for number, entry in enumerate(entries) for goal in entry
    ]
    called = dict[str | int, int]()
    for number, entry in enumerate(entries):
        for reach in reaches(entry):
            called |= {number: number, reach.name or number: number}

    after = {
        number: called[goal.after]
        for number, goal in numbered
        if isinstance(goal, Reach) and goal.after is not None
    }
    circle = find_circle(after)
    if circle is not None:
        problem = "it must be fulfilled before itself; name an earlier goal"
        raise tree.error(("goals", circle, "after"), problem)

    for number, problem in find_conflicts(numbered, scene):
        raise tree.error(("goals", number), problem)


def _resolve(goal: Goal, scene: Scene, marks: Mapping[str, MarkSpec]) -> Goal:
    """Give a goal the bodies that its patterns fit, and what it needs to know of the scene.

    ``marks`` are those of the file, by name.

    Raises:
        UsageError: it names what is not there, or asks what can't be.
        ValueError: likewise.
    """
    changes = dict[str, object]()
    if isinstance(goal, Throughout):
        lasting = _resolve(goal.what, scene, marks)
        assert isinstance(lasting, Reach)
        _check_throughout(lasting, scene)
        return Throughout(lasting)

    for field, what in NAMED.items():
        patterns = getattr(goal, field, None)
        if isinstance(patterns, tuple):
            changes[field] = find_names(patterns, list_names(what, scene))

    if isinstance(goal, Reach):
        changes["also"] = tuple(_resolve(part, scene, marks) for part in goal.also)

    found: Goal = replace(goal, **changes)  # type: ignore[type-var]
    check_names(found, scene)
    if isinstance(found, Kept):
        balls = [name for name in found.keep if _is_round(scene[name], ball=True)]
        rounds = [name for name in found.keep if _is_round(scene[name])]
        found = replace(found, balls=tuple(balls), rounds=tuple(rounds))
    if isinstance(found, Untouched) and found.by:
        _check_apart(found, scene)
    if isinstance(found, Inside):
        found = replace(
            found,
            space=_find_space(scene, found.inside, marks),
            feet={name: find_foot(scene, scene[name]) for name in found.bodies},
            down=scene.gravity,
        )
    if isinstance(found, Reach):
        _check_softness(found, scene)
        _check_enough(found)
        check_meetable(found, scene)

    return found


def _check_enough(goal: Reach) -> None:
    """Refuse a goal that wants more bodies than it has.

    Raises:
        UsageError: says how many there are.
    """
    if isinstance(goal.enough, int) and goal.enough > len(goal.bodies) > 0:
        raise UsageError(
            f"enough: {goal.enough} is a number of bodies, and these are {len(goal.bodies)}; for a share of them write "
            "it with a point, such as 0.8, and for all of them leave it out"
        )


def _check_throughout(what: Reach, scene: Scene) -> None:
    """Refuse what must hold throughout, and does not at the start, so that nothing could ever be earned.

    Raises:
        UsageError: says what was probably meant.
    """
    if needs_fixture(what):
        return

    start = scene.state()
    unmet = what.held or bool(what.progress(start, start) < 1.0)
    if unmet:
        raise UsageError(
            f"throughout means from the start on, and at the start {what.subject} {_IS[len(what.bodies) > 1]} not so: "
            "nothing could be earned; leave throughout out, and it must hold at the end (with held: true, in hand)"
        )


def _check_apart(limit: Untouched, scene: Scene) -> None:
    """Refuse bodies that must not touch and do so at the start, so that nothing could ever be earned.

    Raises:
        UsageError: names two of them.
    """
    if limit.max_force_n:
        return

    for pair, gap in find_gaps(scene, set(limit.by)).items():
        for name, other in (pair, pair[::-1]):
            meet = name in limit.by and other in limit.untouched
            if meet and gap < CONTACT_M:
                raise UsageError(
                    f"{name} must not touch {other}, and begins at it: nothing could be earned; move it, or say where "
                    "it must end"
                )


def _is_round(body: Body, *, ball: bool = False) -> bool:
    """Report whether a body looks the same however it turns about its z; a ball: about any axis."""
    for part in body.collisions:
        offset = part.pose.position if ball else part.pose.position[:2]
        turned = part.pose.rotation.apply([0.0, 0.0, 1.0])
        upright = abs(float(turned[2])) > 1 - 1e-9
        alike = part.shape.is_ball or (not ball and part.shape.is_round and upright)
        if not alike or np.abs(offset).max() > 1e-9:
            return False

    return bool(body.collisions)


def _find_space(scene: Scene, name: str, marks: Mapping[str, MarkSpec]) -> Space:
    """Return the hollow of a body, or the space of a mark.

    What a body lacks of walls may be what it stands at, such as the table under it.

    Raises:
        UsageError: it has none.
    """
    body = scene[name]
    if name == FIXTURE:
        return FixtureHollow(tuple(body for body in scene.bodies if body.fixed))
    if name in marks:
        return space_of(build_mark(marks[name]), marks[name].height)

    found = None
    if body.collisions:
        found = find_hollow(body) or find_hollow(body, scene.bodies)
    if found is None:
        raise UsageError(
            f"{body.name!r} has no hollow with walls all around; give marks one with a shape, such as {{name: inner, "
            "box: [0.1, 0.1, 0.1], position: [0.6, 0, 0.05]}, and write inside: inner"
        )

    return found


def _check_softness(goal: Reach, scene: Scene) -> None:
    """Refuse what can't be asked of soft bodies, and what can be asked of them alone.

    Raises:
        UsageError: says which.
    """
    for part in goal.parts:
        node = max(getattr(part, "nodes", ()), default=getattr(part, "node", None))
        soft = node is not None or isinstance(part, Flattened | Spread)
        if isinstance(part, Apart) and len(goal.bodies) < 2 and not part.nodes:
            raise UsageError("apart needs two bodies, or nodes: [0, 9] of a soft one")

        for name in goal.bodies:
            body = scene[name]
            nodes = 0
            if isinstance(body, Soft):
                nodes = len(body.form.nodes)
            if soft and not 0 <= (node or 0) < nodes:
                what = "node and nodes (from 0), max_height_m and min_area_m2 are for soft bodies"
                raise UsageError(f"{what}; {name!r} has {nodes} nodes")

            if nodes and isinstance(part, Turned | TurnedBy | Facing):
                raise UsageError(f"the soft body {name!r} has no axis; its nodes move")

"""Give the goals of a scene file the names and hollows of its scene."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase

from core.errors import UsageError, choices
from core.goals import (
    NAMED,
    Facing,
    Goal,
    Reach,
    Turned,
    check_names,
    list_names,
    reaches,
)
from core.scene import Body, Scene, Soft
from plugins.tasks.file.goals import join_entries
from plugins.tasks.file.hollows import Hollow, find_hollow, space_of
from plugins.tasks.file.kinds import (
    Apart,
    Flattened,
    Inside,
    Spread,
    Throughout,
    TurnedBy,
)
from plugins.tasks.file.spec import SceneSpec
from plugins.tasks.file.tree import Tree

_GLOB = re.compile(r"[*?\[]")


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

    entries = []
    for number, entry in enumerate(spec.goals):
        try:
            entries.append(tuple(_resolve(goal, scene) for goal in entry))
            for reach in reaches(entry):
                if reach.after is not None and reach.after not in names:
                    problem = choices("goal", str(reach.after), map(str, names))
                    raise tree.error(("goals", number, "after"), str(problem))
        except (UsageError, ValueError) as error:
            raise tree.error(("goals", number), str(error)) from None

    return join_entries(entries)


def _resolve(goal: Goal, scene: Scene) -> Goal:
    """Give a goal the bodies that its patterns fit, and what it needs to know of the scene.

    Raises:
        UsageError: it names what is not there, or asks what can't be.
        ValueError: likewise.
    """
    changes = dict[str, object]()
    if isinstance(goal, Throughout):
        return Throughout(_resolve(goal.what, scene))  # type: ignore[arg-type]

    for field, what in NAMED.items():
        patterns = getattr(goal, field, None)
        if isinstance(patterns, tuple):
            changes[field] = find_names(patterns, list_names(what, scene))

    if isinstance(goal, Reach):
        changes["also"] = tuple(_resolve(part, scene) for part in goal.also)

    found: Goal = replace(goal, **changes)  # type: ignore[type-var]
    check_names(found, scene)
    if isinstance(found, Inside):
        found = replace(found, hollow=_find_space(scene[found.inside]))
    if isinstance(found, Reach):
        _check_softness(found, scene)

    return found


def _find_space(body: Body) -> Hollow:
    """Return the hollow of a body, or the space of a mark.

    Raises:
        UsageError: it has none.
    """
    if not body.collisions and not isinstance(body, Soft):
        return space_of(body)

    found = None
    if body.collisions:
        found = find_hollow(body)
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

"""Read the goals of a scene file: the kinds that an entry of ``goals`` stands for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, fields, replace
from typing import Any

from core.errors import UserError
from core.goals import (
    Apart,
    Away,
    Broken,
    Facing,
    Flattened,
    Goal,
    Inside,
    JointAt,
    Kept,
    Placed,
    Reach,
    Span,
    Spread,
    Throughout,
    Turned,
    TurnedBy,
    Unbroken,
    Untouched,
    needs_fixture,
    reaches,
)
from core.support.templates import macros

NAMED = 4  # bodies of a goal that a description names, where there are more

WAYS: Mapping[str, type[Goal]] = {
    "place": Placed,
    "places": Placed,
    "inside": Inside,
    "away": Away,
    "joint": JointAt,
}
"""Kinds that say how far there is to go, of which an entry has at most one."""

KINDS: Mapping[str, type[Goal]] = {
    **WAYS,
    "moved": Placed,
    "raised": Placed,
    "apart": Apart,
    "max_height_m": Flattened,
    "min_area_m2": Spread,
    "axis": Turned,
    "angle_deg": Turned,
    "turned_deg": TurnedBy,
    "facing": Facing,
    "keep": Kept,
    "untouched": Untouched,
    "broken": Broken,
    "unbroken": Unbroken,
}
"""The kinds of goals, by the key that an entry of a file has them by."""

FILLED = {
    "relative",
    "space",
    "feet",
    "down",
    "also",
    "balls",
    "rounds",
    "mean",
}
"""Fields of kinds that no entry has: they are made of others."""

ENDS = {"rest", "held", "released"}
"""What bodies can be asked for at the end, wherever they are."""

THROUGHOUT = "throughout"

TOLERANCE = 0.01
"""How far off a bare number still is there, m or rad, where an entry has no ``tolerance``."""

Entry = tuple[Goal, ...]
Given = Mapping[str, Any]


def read_entry(given: Given) -> Entry:
    """Make the goals that an entry stands for: one to reach, if it has one, and limits.

    Raises:
        ValueError: there is nothing to reach, two ways to go, a key that is missing, or one that says nothing.
    """
    known = given.keys()
    given = _read_keep(given)
    kinds = _find_kinds(given)
    reaching = any(issubclass(kind, Reach) for kind in kinds.values())
    if not reaching and ENDS & given.keys():
        kinds = {"bodies": Reach, **kinds}
        reaching = True
    if not kinds or len(WAYS.keys() & kinds.keys()) > 1:
        raise ValueError(
            "a goal needs either place or away (the distance from the start), or places, inside, or joint and to, not "
            f"two of these; or one of {', '.join(sorted(ENDS))}, {', '.join(key for key in KINDS if key not in WAYS)}"
        )

    goals = [_make(key, kind, given) for key, kind in kinds.items()]
    used = {THROUGHOUT} if reaching else set[str]()
    for key, kind in kinds.items():
        used |= {key} | TAKES.get(key, set())
        used |= {field.name for field in fields(kind)}  # type: ignore[arg-type]

    idle = sorted((known & given.keys()) - used)
    if idle:
        raise ValueError(_explain_idle(idle[0], kinds))

    reached = [goal for goal in goals if isinstance(goal, Reach)]
    limits = [goal for goal in goals if not isinstance(goal, Reach)]
    if not reached:
        return tuple(limits)

    first, *others = reached
    if isinstance(reached[-1], Broken):
        _check_alone(reached)
    elif bool(first.bodies) == isinstance(first, JointAt):
        raise ValueError("a goal needs either 'bodies', a list of names, or a 'joint'")

    whole = replace(first, also=tuple(others))
    if given.get(THROUGHOUT) and "keep" not in given:
        return (Throughout(whole), *limits)

    return (whole, *limits)


def _check_alone(reached: Sequence[Reach]) -> None:
    """Refuse ``broken`` beside another thing to reach.

    Raises:
        ValueError: there is one.
    """
    if len(reached) > 1:
        raise ValueError(
            "broken is a goal of its own; write what else is wanted as another one, with every: true"
        )


def _find_kinds(given: Given) -> dict[str, type[Goal]]:
    """Return the kinds that an entry names, by key."""
    kinds = {key: kind for key, kind in KINDS.items() if key in given}
    if {"angle_deg", "facing"} & kinds.keys():  # then the axis is theirs
        kinds.pop("axis", None)

    return kinds


def _read_keep(given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Read ``bodies: NAMES`` and ``keep: throughout`` as ``keep: NAMES`` and ``throughout: true``.

    Raises:
        ValueError: something else is to be reached with these bodies.
    """
    if given.get("keep") != THROUGHOUT:
        return given

    names = given.get("bodies")
    others = given.keys() - {"bodies", "keep", "kept_m", "kept_deg"}
    if names is None or others:
        raise ValueError(
            "keep needs names here; to say that bodies stay all the time, write keep: [NAME, ...] and throughout: true"
        )

    kept = {key: value for key, value in given.items() if key != "bodies"}
    return {**kept, "keep": names, THROUGHOUT: True}


def _fill_moved(moved: Any, given: Given) -> dict[str, Any]:
    return {"place": moved, "places": (), "relative": True}


def _fill_raised(raised: Any, given: Given) -> dict[str, Any]:
    return _fill_moved((None, None, raised), given)


def _fill_joint(joint: Any, given: Given) -> dict[str, Any]:
    if "change" in given and "to" in given:
        raise ValueError("a joint has to (a position) or change (from its start)")
    if "change" in given:
        return {"to": given["change"], "relative": True}

    return {}


def _fill_angle(angle: Any, given: Given) -> dict[str, Any]:
    span = Span.about(angle, given.get("tolerance_deg", Turned.tolerance_deg))
    return {"angle_deg": span, "turned_deg": span}


FILLS: Mapping[str, Callable[[Any, Given], dict[str, Any]]] = {
    "moved": _fill_moved,
    "raised": _fill_raised,
    "joint": _fill_joint,
    "angle_deg": _fill_angle,
    "turned_deg": _fill_angle,
}
"""What makes those fields of a kind that an entry has otherwise, by its key: of its value, and of the whole entry."""


def _explain_idle(key: str, kinds: Iterable[str]) -> str:
    """Say that a key means nothing beside others, and with which it does.

    Args:
        key: of an entry.
        kinds: keys of the kinds that the entry has.
    """
    goes_with = [
        other
        for other, kind in KINDS.items()
        if key in {field.name for field in fields(kind)}  # type: ignore[arg-type]
    ]
    text = f"{key} says nothing in a goal with {', '.join(kinds)}"
    return f"{text}; it goes with {' or '.join(goes_with)}" if goes_with else text


TAKES: Mapping[str, set[str]] = {
    "joint": {"change"},
    "turned_deg": {"tolerance_deg"},
}
"""The keys that they read besides."""


def _make(key: str, kind: type[Goal], given: Given) -> Goal:
    """Make a goal of what its kind takes."""
    filled = {"tolerance": TOLERANCE, **given}
    if key in FILLS:
        filled |= FILLS[key](given[key], given)

    taken = [field for field in fields(kind) if field.init]  # type: ignore[arg-type]
    for field in taken:
        needed = field.default is MISSING and field.default_factory is MISSING
        if needed and field.name not in filled:
            raise ValueError(f"a goal with {key!r} needs {field.name!r}, too")

    return kind(**{f.name: filled[f.name] for f in taken if f.name in filled})


def join_entries(entries: Sequence[Entry]) -> tuple[Goal, ...]:
    """Put the goals of all entries in a row, and let ``after`` count these."""
    first = 0
    firsts = dict[str | int | None, int]()
    for number, entry in enumerate(entries):
        firsts[number] = first
        first += len(entry)

    goals = list[Goal]()
    for entry in entries:
        for goal in entry:
            if isinstance(goal, Reach) and goal.after in firsts:
                goals.append(replace(goal, after=firsts[goal.after]))
            else:
                goals.append(goal)

    return tuple(goals)


def describe_goals(goals: Sequence[Goal], every: bool = False) -> list[str]:
    """Describe goals and the reward that `goals_reward` makes of them, in lines."""
    lines = [f"{number}. {describe(goal)}" for number, goal in enumerate(goals)]
    wanted = reaches(goals)
    if wanted:
        lines.append(
            "The progress of a goal is max(0, 1 - d / d0). Here d is how far its bodies are from it at the end, beyond "
            "the tolerance or limit, d0 the same at the start; of several bodies it is the mean, and any one is the "
            "best."
        )

    if any(needs_fixture(goal) for goal in goals):
        lines.append(
            "The fixture is what the design adds to the scene. Nothing is earned for a goal that names it where there "
            "is none."
        )

    counts = "the mean of the goals' progress, by weight"
    if len(wanted) < 2:
        counts = "the progress"
    elif not every:
        counts = "the progress of the best goal"

    if not wanted:
        counts = "0: nothing is to be reached"

    return [*lines, f"The reward is {counts}."]


def describe(goal: Goal) -> str:
    """Say in words what a goal wants."""
    if isinstance(goal, Throughout):
        return f"throughout, or less is earned: {describe(goal.what)}"
    if not isinstance(goal, Reach):
        return _ask(goal)

    when = {
        _say_enough(goal): goal.enough is not None,
        "must end at rest": goal.rest,
        "must end held by the robot, touching nothing fixed (half counts if it is only touched)": goal.held,
        "must end released, touched by no part of the robot, nor by what touches it": goal.released,
        f"by {goal.by_s or 0:g} s after the motion begins": goal.by_s is not None,
        "at any time, not at the end": goal.ever,
        f"after goal {goal.after}": goal.after is not None,
        f"weight {goal.weight:g}": goal.weight != 1,
    }
    asked = [_ask(part) for part in goal.parts]
    asked += [words for words, applies in when.items() if applies]
    described = f"{_subject(goal)} {'; '.join(filter(None, asked))}"
    return f"{goal.name}: {described}" if goal.name else described


def _say_enough(goal: Reach) -> str:
    """Say how many of a goal's bodies are enough."""
    is_share = isinstance(goal.enough, float)
    if goal.enough == 1 and is_share:
        return "all of these bodies are needed"
    if goal.enough == 1:
        return "one of these bodies is enough"

    enough = goal.enough or 0
    share = f"{100 * enough:g} %" if is_share else f"{enough:g}"
    return f"of these bodies {share} are enough"


def _subject(goal: Reach) -> str:
    """Say what a goal is about; of many bodies the first, the last and how many."""
    if len(goal.bodies) <= NAMED:
        return goal.subject

    first, *_, last = goal.bodies
    wanted = f"all {len(goal.bodies)}"
    if goal.any:
        wanted = "any"

    return f"{wanted} of {first} to {last}"


def _ask(goal: Goal) -> str:
    """Fill in the macro of a goal's kind in ``templates/goals.md.j2``.

    Raises:
        UserError: there is none.
    """
    kind = type(goal).__name__
    phrase = getattr(macros("plugins.tasks.file", "goals"), kind, None)
    if phrase is None:
        raise UserError(
            f"goals of the kind {kind} have no words for a model; add a macro {kind}(goal) to "
            "plugins/tasks/file/templates/goals.md.j2"
        )

    return str(phrase(goal))

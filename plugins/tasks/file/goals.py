"""Read the goals of a scene file: what an entry of ``goals`` stands for."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import cast

from core.goals import (
    KINDS,
    Given,
    Goal,
    Reach,
    Throughout,
    limits,
    reaches,
)
from core.plugins import installed
from core.support.templates import fill

ENDS = ("held", "released", "rest", "stands_on")
"""What bodies can be asked for at the end, wherever they are."""

ALL_KINDS: tuple[type[Goal], ...] = (
    *KINDS,
    *cast("dict[str, type[Goal]]", installed().factories("goal")).values(),
)
"""The kinds of goals that scene files know: ours, and those of plugins."""


def _list_heads(*, way: bool) -> dict[str, type[Goal]]:
    """Return the kinds by the keys for which an entry wants one, of those that say a way to go or not."""
    heads = dict[str, type[Goal]]()
    for kind in ALL_KINDS:
        for key, said in kind.keys.items():
            if said.way == way and (said.way or said.head):
                heads[key] = kind

    return heads


HEADS = _list_heads(way=True) | _list_heads(way=False)
"""The kinds of goals by the keys for which an entry wants one: first those that say a way to go."""

Entry = tuple[Goal, ...]


def read_entry(given: Given) -> Entry:
    """Make the goals that an entry stands for: one to reach, if it has one, and limits.

    Raises:
        ValueError: there is nothing to reach, two ways to go, a key that is missing, or one that says nothing.
    """
    for kind in ALL_KINDS:
        given = kind.prepare(given)

    heads = _find_heads(given)
    ways = [key for key, kind in heads.items() if kind.keys[key].way]
    reaching = any(issubclass(kind, Reach) for kind in heads.values())
    if not reaching and given.keys() & {*ENDS}:
        heads = {"bodies": Reach, **heads}
    if not (heads or given.get("also")) or len(ways) > 1:
        ways = [key for key, kind in HEADS.items() if kind.keys[key].way]
        others = [key for key in HEADS if key not in ways]
        raise ValueError(
            f"a goal needs one of {', '.join(ways)}, not two of these; or one of {', '.join([*ENDS, *others])}"
        )

    own = {key: value for key, value in given.items() if key != "also"}
    goals = [kind.read(key, own) for key, kind in heads.items()]
    used = set[str]()
    if given.get("also"):
        used |= Reach.keys.keys()
    for kind in heads.values():
        used |= kind.keys.keys()

    idle = sorted(given.keys() - used)
    if idle:
        raise ValueError(_explain_idle(idle[0], heads))

    forbidden = limits(goals)
    reached = [*reaches(goals), *_read_also(given)]
    if not reached:
        return tuple(forbidden)

    whole = _join(reached)
    if given.get("throughout") and not any("throughout" in f.keys for f in forbidden):
        return (Throughout(whole), *forbidden)

    return (whole, *forbidden)


def _find_heads(given: Given) -> dict[str, type[Goal]]:
    """Return the kinds that an entry wants, by key; a weak one is left to another kind that takes it."""
    heads = {key: kind for key, kind in HEADS.items() if key in given}
    for key, kind in list(heads.items()):
        others = [other for name, other in heads.items() if name != key]
        if kind.keys[key].weak and any(key in other.keys for other in others):
            del heads[key]

    return heads


def _read_also(given: Given) -> list[Reach]:
    """Read what an entry wants of its bodies also, each with what the entry says of all.

    Raises:
        ValueError: it has no sense.
    """
    shared = {key: given[key] for key in Reach.keys.keys() - {"also"} if key in given}
    found = list[Reach]()
    for other in given.get("also", ()):
        (goal,) = reaches(read_entry({**shared, **other}))
        found += [replace(part, also=()) for part in goal.parts]

    return found


def _join(reached: Sequence[Reach]) -> Reach:
    """Join what is to be reached of the same bodies at once.

    Raises:
        ValueError: something of it is a goal of its own, or is about no bodies.
    """
    first, *others = reached
    for goal in reached:
        if (others and goal.alone) or (goal.bodies and not goal.of_bodies):
            raise ValueError(
                f"{goal.subject} is a goal of its own, without bodies; write what else is wanted as another one, with "
                "every: true"
            )

    return replace(first, also=tuple(others)) if others else first


def _explain_idle(key: str, heads: Iterable[str]) -> str:
    """Say that a key means nothing beside others, and with which it does.

    Args:
        key: of an entry.
        heads: keys of the kinds that the entry has.
    """
    goes_with = [head for head, kind in HEADS.items() if key in kind.keys]
    text = f"{key} says nothing in a goal with {', '.join(heads)}"
    return f"{text}; it goes with {' or '.join(goes_with)}" if goes_with else text


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
    wanted = len(reaches(goals))
    package = "plugins.tasks.file"
    return fill(package, "goals", goals=goals, wanted=wanted, every=every).splitlines()

"""Read the goals of a scene file: the kinds that an entry of ``goals`` stands for, and those that only files have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, replace
from typing import Any

from core.geometry import Array
from core.goals import (
    Away,
    Coordinates,
    Goal,
    JointAt,
    Kept,
    Measure,
    Placed,
    Reach,
    Turned,
    Untouched,
    reaches,
)
from core.support.templates import macros
from core.values.states import State

SLIP_SHARE = 0.2  # of a limit of height or area: what is so far off counts as lost


@dataclass(frozen=True, kw_only=True)
class Places(Reach):
    """Bodies that must end at ``places``, one for each; the rest is as for `Placed`.

    Raises:
        ValueError: there are not as many places as bodies.
    """

    places: tuple[Coordinates, ...]
    at: str | None = None
    tolerance: float = 0.0
    node: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.places) != len(self.bodies):
            raise ValueError(
                f"a goal's places need one for each of its {len(self.bodies)} bodies"
            )

    def measures(self, body: str, start: State) -> Sequence[Measure]:
        return self._placed(body).measures(body, start)

    def place_of(self, body: str, start: State) -> Array | None:
        return self._placed(body).place_of(body, start)

    def _placed(self, body: str) -> Placed:
        """Return the goal of one of the bodies."""
        place = self.places[self.bodies.index(body)]
        return Placed(place=place, at=self.at, tolerance=self.tolerance, node=self.node)


@dataclass(frozen=True, kw_only=True)
class Flattened(Reach):
    """Soft bodies that must end at most ``max_height_m`` high, from their lowest node to their highest."""

    max_height_m: float

    def measures(self, body: str, start: State) -> Sequence[Measure]:
        def height(state: State) -> Any:
            return state.extent(body)[..., 2]

        slip = SLIP_SHARE * self.max_height_m
        return [Measure(f"height of {body}", height, self.max_height_m, slip, "m")]


@dataclass(frozen=True, kw_only=True)
class Spread(Reach):
    """Soft bodies each of which must cover at least ``min_area_m2`` at the end, as seen from above."""

    min_area_m2: float

    def measures(self, body: str, start: State) -> Sequence[Measure]:
        def area(state: State) -> Any:
            return state.covered_area(body)

        least = self.min_area_m2
        name = f"area of {body}"
        return [Measure(name, area, least, SLIP_SHARE * least, "m^2", at_least=True)]


WAYS: Mapping[str, type[Goal]] = {
    "place": Placed,
    "places": Places,
    "away": Away,
    "joint": JointAt,
}
"""Kinds that say how far there is to go, of which an entry has at most one."""

KINDS: Mapping[str, type[Goal]] = {
    **WAYS,
    "max_height_m": Flattened,
    "min_area_m2": Spread,
    "axis": Turned,
    "keep": Kept,
    "untouched": Untouched,
}
"""The kinds of goals, by the key that an entry of a file has them by."""

ENDS = {"rest", "held", "released"}
"""What bodies can be asked for at the end, wherever they are."""

THROUGHOUT = "throughout"

Entry = tuple[Goal, ...]


def read_entry(given: Mapping[str, Any]) -> Entry:
    """Make the goals that an entry stands for: one to reach, if it has one, and limits.

    Raises:
        ValueError: there is nothing to reach, two ways to go, a key that is missing, or one that says nothing.
    """
    given = _read_keep(given)
    kinds = {key: kind for key, kind in KINDS.items() if key in given}
    reaching = any(issubclass(kind, Reach) for kind in kinds.values())
    if not reaching and ENDS & given.keys():
        kinds = {"bodies": Reach, **kinds}
    if not kinds or len(WAYS.keys() & kinds.keys()) > 1:
        raise ValueError(
            "a goal needs either place or away (the distance from the start), or places, or joint and to, not two of "
            f"these; or one of {', '.join(sorted(ENDS))}, {', '.join(key for key in KINDS if key not in WAYS)}"
        )

    goals = [_make(key, kind, given) for key, kind in kinds.items()]
    known = set[str]()
    for kind in kinds.values():
        known |= {field.name for field in fields(kind)}  # type: ignore[arg-type]
    idle = sorted(given.keys() - known)
    if idle:
        raise ValueError(f"{idle[0]} says nothing in a goal with {', '.join(kinds)}")

    reached = [goal for goal in goals if isinstance(goal, Reach)]
    limits = [goal for goal in goals if not isinstance(goal, Reach)]
    if not reached:
        return tuple(limits)
    first, *others = reached
    if bool(first.bodies) == isinstance(first, JointAt):
        raise ValueError("a goal needs either 'bodies', a list of names, or a 'joint'")
    return (replace(first, also=tuple(others)), *limits)


def _read_keep(given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Read ``bodies: NAMES`` and ``keep: throughout`` as ``keep: NAMES`` and ``throughout: true``.

    Raises:
        ValueError: something else is to be reached with these bodies.
    """
    if given.get("keep") != THROUGHOUT:
        return given
    names = given.get("bodies")
    others = given.keys() - {"bodies", "keep", "kept_m"}
    if names is None or others:
        raise ValueError(
            "keep needs names here; to say that bodies stay all the time, write keep: [NAME, ...] and throughout: true"
        )
    kept = {key: value for key, value in given.items() if key != "bodies"}
    return {**kept, "keep": names, THROUGHOUT: True}


def _make(key: str, kind: type[Goal], given: Mapping[str, Any]) -> Goal:
    """Make a goal of what its kind takes."""
    taken = [field for field in fields(kind) if field.init]  # type: ignore[arg-type]
    for field in taken:
        if field.default is MISSING and field.name not in given:
            raise ValueError(f"a goal with {key!r} needs {field.name!r}, too")
    return kind(**{f.name: given[f.name] for f in taken if f.name in given})


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
    if not isinstance(goal, Reach):
        return _ask(goal)
    when = {
        "must end at rest": goal.rest,
        "must end held by the robot, touching nothing fixed (half counts if it is only touched)": goal.held,
        "must end released, touched by no part of the robot (half counts if touched, but not held)": goal.released,
        f"by {goal.by_s or 0:g} s after the motion begins": goal.by_s is not None,
        "at any time, not at the end": goal.ever,
        f"after goal {goal.after}": goal.after is not None,
        f"weight {goal.weight:g}": goal.weight != 1,
    }
    asked = [_ask(part) for part in goal.parts]
    asked += [words for words, applies in when.items() if applies]
    described = f"{goal.subject} {'; '.join(filter(None, asked))}"
    return f"{goal.name}: {described}" if goal.name else described


def _ask(goal: Goal) -> str:
    """Fill in the macro of a goal's kind in ``templates/goals.md.j2``."""
    phrases = macros("plugins.tasks.file", "goals")
    return str(getattr(phrases, type(goal).__name__)(goal))

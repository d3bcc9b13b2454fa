"""Give the goals of a scene file the names and hollows of its scene."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

from core.errors import UsageError, UserError, choices
from core.goals import Goal, Space, limits, reaches
from core.scene import FIXTURE, Scene
from core.solids.standing import find_gaps
from plugins.tasks.file.body_building import build_mark
from plugins.tasks.file.contacts import CONTACT_M
from plugins.tasks.file.goals import Entry, join_entries
from plugins.tasks.file.hollows import FixtureHollow, find_hollow, space_of
from plugins.tasks.file.refusals import SceneReason
from plugins.tasks.file.scene_warnings import find_foot
from plugins.tasks.file.spec import MarkSpec, SceneSpec
from plugins.tasks.file.tree import Tree, as_coded


@dataclass(frozen=True)
class FileSite:
    """A scene of a file, as `core.goals.Site` says; ``marks`` are those of the file, by name."""

    scene: Scene
    marks: Mapping[str, MarkSpec]

    def find_space(self, name: str) -> Space:
        """See `core.goals.Site`. What a body lacks of walls may be what it stands at, such as the table under it."""
        body = self.scene[name]
        if name == FIXTURE:
            return FixtureHollow(tuple(b for b in self.scene.bodies if b.fixed))
        if name in self.marks:
            return space_of(build_mark(self.marks[name]), self.marks[name].height)

        found = None
        if body.collisions:
            found = find_hollow(body) or find_hollow(body, self.scene.bodies)
        if found is None:
            raise UsageError(
                f"{body.name!r} has no hollow with walls all around; give marks one with a shape, such as {{name: "
                "inner, box: [0.1, 0.1, 0.1], position: [0.6, 0, 0.05]}, and write inside: inner"
            )

        return found

    def find_foot(self, name: str) -> float:
        """See `core.goals.Site`."""
        return find_foot(self.scene, self.scene[name])

    def find_touching(self, names: Iterable[str]) -> Iterator[tuple[str, str]]:
        """See `core.goals.Site`."""
        for pair, gap in find_gaps(self.scene, set(names)).items():
            if gap < CONTACT_M:
                yield pair


def build_goals(tree: Tree, spec: SceneSpec, scene: Scene) -> tuple[Goal, ...]:
    """Build the goals of all entries, with the names and hollows of a scene.

    Raises:
        UserError: one names what is not there, or asks what can't be.
    """
    site = FileSite(scene, {mark.name: mark for mark in spec.marks})
    entries = []
    for number, entry in enumerate(spec.goals):
        try:
            entries.append(tuple(goal.resolve(site) for goal in entry))
        except (UsageError, ValueError) as error:
            raise tree.error(("goals", number), as_coded(error)) from None

    _check_order(tree, entries)
    _check_conflicts(tree, entries, scene)
    goals = join_entries(entries)
    if not reaches(goals):
        raise tree.error(("goals",), UserError.because(SceneReason.NOTHING_EARNED))

    return goals


def _check_order(tree: Tree, entries: Sequence[Entry]) -> None:
    """Refuse an entry that comes after one that is not there, or after itself.

    Raises:
        UserError: says which.
    """
    called = dict[str | int, int]()  # entries that another may come after
    for number, entry in enumerate(entries):
        for reach in reaches(entry):
            called |= {number: number, reach.name or number: number}

    after = dict[int, list[int]]()
    for number, entry in enumerate(entries):
        for reach in reaches(entry):
            if reach.after is None:
                continue
            if reach.after not in called:
                unknown = choices("goal", str(reach.after), map(str, called))
                raise tree.error(("goals", number, "after"), unknown)

            after[number] = [called[reach.after]]

    try:
        TopologicalSorter(after).prepare()
    except CycleError as error:
        where = ("goals", min(error.args[1]), "after")
        problem = UserError.because(SceneReason.GOAL_CIRCLE)
        raise tree.error(where, problem) from None


def _check_conflicts(tree: Tree, entries: Sequence[Entry], scene: Scene) -> None:
    """Refuse an entry that asks what another one forbids.

    Raises:
        UserError: says which, and why they can't be met together.
    """
    forbidding = [limit for entry in entries for limit in limits(entry)]
    for number, entry in enumerate(entries):
        for wanted in reaches(entry):
            for limit in forbidding:
                problem = limit.find_conflict(wanted, scene)
                if problem:
                    conflict = UserError.because(
                        SceneReason.GOAL_CONFLICT, problem=problem
                    )
                    raise tree.error(("goals", number), conflict)

"""Say how many bodies of a goal to reach must get there, how and when: what is the same for all kinds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, ClassVar

import numpy as np

from core.errors import UsageError, refuse
from core.geometry import Array
from core.goals.goal import Goal
from core.goals.keys import AboveZero, Enough, Key, Names
from core.goals.sites import FREE_BODY, SOLID_BODY, Site
from core.scene import Scene

NAMED = 4  # bodies that a description names, where there are more


@dataclass(frozen=True)
class Terms(Goal):
    """How many bodies must get where a goal wants them, how and when; see `core.goals.Reach`.

    Attributes:
        bodies: their names; in a scene file also patterns, such as "grain*".
        any: whether one of the bodies is enough.
        enough: how many bodies are enough, a whole number such as 3, or a share such as 0.8 or 1.0; None: all of them.
        also: further goals that the same bodies must meet at once, without their names.
        rest: whether they must end at rest, and with a trace have rested for 0.3 s.
        held: whether the robot alone must bear them at the end.
        released: whether the robot must have let go of them at the end.
        stands_on: the body that must bear them at the end; None: any.
        by_s: the time by which the goal must be met, s from the start of the motion.
        ever: whether meeting the goal at any time is enough; otherwise it must be met at the end.
        after: the ``name`` or number (from 0) of a goal that must be met before this one.
        weight: how much the goal counts if all goals do.
        name: what other goals and reports call it.
        of_bodies: whether the kind is about ``bodies``; else other fields say what it is about.
    """

    bodies: tuple[str, ...] = ()
    _: KW_ONLY
    any: bool = False
    enough: int | float | None = None
    also: tuple[Terms, ...] = ()
    rest: bool = False
    held: bool = False
    released: bool = False
    stands_on: str | None = None
    by_s: float | None = None
    ever: bool = False
    after: str | int | None = None
    weight: float = 1.0
    name: str = ""

    keys: ClassVar = {
        "bodies": Key(Names, 'Their names, or patterns such as "grain*"'),
        "any": Key(bool, "Whether one of the bodies is enough"),
        "enough": Key(
            Enough,
            "How many of the bodies are enough, a whole number such as 3, or which share of them, with a point such as "
            "0.8 or 1.0",
        ),
        "also": Key(
            Any,
            "What else must hold of the same bodies at once, as further keys say it, too",
        ),
        "rest": Key(bool, "Whether they must end at rest"),
        "held": Key(
            bool,
            "Whether they must end in the robot's hand, touching nothing fixed",
        ),
        "released": Key(bool, "Whether they must end touched by no part of the robot"),
        "stands_on": Key(
            str, "The body on which they must stand at the end, such as fixture"
        ),
        "by_s": Key(
            AboveZero,
            "Until when it must be reached, s from the beginning of the motion",
        ),
        "ever": Key(bool, "Whether it is enough to reach it at any time"),
        "after": Key(
            str | int,
            "The goal that must be reached before this one is, by number from 0 or by name",
        ),
        "weight": Key(AboveZero, "How much it counts beside others"),
        "name": Key(str, "By which other goals and reports call it"),
        "throughout": Key(
            bool,
            "Whether it must hold all the time, also before the robot moves; leave it out if it holds only later",
        ),
    }
    names: ClassVar = {"bodies": FREE_BODY, "stands_on": SOLID_BODY}
    of_bodies: ClassVar[bool] = True

    def __post_init__(self) -> None:
        ends = self._list_ends()
        asked = [part._list_ends() for part in self.also]
        misplaced = np.greater(asked or ends, ends).any()

        refuse(
            "a goal's ",
            {
                "enough must be above 0": self.enough is not None and self.enough <= 0,
                "enough must be a whole number of bodies, or a share of them up to 1.0": (
                    isinstance(self.enough, float) and self.enough > 1
                ),
                "any and enough both say how many; leave one of them out": (
                    self.any and self.enough is not None
                ),
                "weight must be above 0": not 0 < self.weight < np.inf,
                "by_s must be above 0": self.by_s is not None and not self.by_s > 0,
                "held and released say the opposite; leave one of them out": (
                    self.held and self.released
                ),
                "rest, held, released and stands_on stand in the goal itself, not in also": bool(
                    misplaced
                ),
            },
        )

    @property
    def subject(self) -> str:
        """What it is about, in words."""
        return (" or " if self.any else ", ").join(self.bodies)

    def label(self, number: int) -> str:
        """Return its name, or what it is about and its number among the goals."""
        what = ", ".join(self.bodies[:3]) or self.subject
        return self.name or f"{what} (goal {number})"

    @property
    def needs_trace(self) -> bool:
        """Whether it asks for a time, or for what the robot touches."""
        in_time = self.by_s is not None or self.ever or self.after is not None
        return any(self._list_ends()) or in_time

    def _list_ends(self) -> list[bool]:
        """List whether each thing is asked for at the end, wherever bodies are."""
        return [self.rest, self.held, self.released, self.stands_on is not None]

    def average(self, shares: Sequence[Array]) -> Array:
        """Average the shares (...) of the best of its things: of as many as are enough."""
        if not shares:
            raise ValueError("a goal to reach needs bodies")

        best = self.count_enough(len(shares))
        counted = np.array(shares)
        if best < len(shares):
            counted = np.sort(shares, axis=0)[-best:]
        return np.asarray(np.mean(counted, axis=0))

    def count_enough(self, bodies: int) -> int:
        """Return how many of so many bodies are enough."""
        if self.any:
            return 1
        if self.enough is None:
            return bodies
        if isinstance(self.enough, float):
            return math.ceil(round(self.enough * bodies, 9))
        return min(self.enough, bodies)

    def needs_some(self, things: int, forbidden: int) -> bool:
        """Report whether it needs one of the forbidden things: the others are not enough."""
        return forbidden > 0 and self.count_enough(things) > things - forbidden

    def say_terms(self) -> list[str]:
        """Say how many of its bodies, how and when."""
        when = {
            self._say_enough(): self.enough is not None,
            "must end at rest": self.rest,
            "must end held by the robot, touching nothing fixed (half counts if it is only touched)": self.held,
            "must end released, touched by no part of the robot, nor by what touches it": self.released,
            f"must end standing on {self.stands_on}": self.stands_on is not None,
            f"by {self.by_s or 0:g} s after the motion begins": self.by_s is not None,
            "at any time, not at the end": self.ever,
            f"after goal {self.after}": self.after is not None,
            f"weight {self.weight:g}": self.weight != 1,
        }
        return [words for words, applies in when.items() if applies]

    def _say_enough(self) -> str:
        """Say how many of the bodies are enough."""
        is_share = isinstance(self.enough, float)
        if self.enough == 1 and is_share:
            return "all of these bodies are needed"
        if self.enough == 1:
            return "one of these bodies is enough"

        enough = self.enough or 0
        share = f"{100 * enough:g} %" if is_share else f"{enough:g}"
        return f"of these bodies {share} are enough"

    def say_subject(self) -> str:
        """Say what it is about; of many bodies the first, the last and how many."""
        if len(self.bodies) <= NAMED:
            return self.subject

        first, *_, last = self.bodies
        wanted = "any" if self.any else f"all {len(self.bodies)}"
        return f"{wanted} of {first} to {last}"

    def check_names(self, scene: Scene) -> None:
        if self.of_bodies and not self.bodies:
            raise UsageError("a goal to reach needs bodies, a list of names")

        super().check_names(scene)

    def find_faults(self, site: Site) -> Iterator[str]:
        if isinstance(self.enough, int) and self.enough > len(self.bodies) > 0:
            yield (
                f"enough: {self.enough} is a number of bodies, and these are {len(self.bodies)}; for a share of them "
                "write it with a point, such as 0.8, and for all of them leave it out"
            )

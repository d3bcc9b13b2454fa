"""Define what all kinds of goals say: measure, words, keys, and what is wrong with one in a scene."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields, replace
from functools import lru_cache
from typing import Any, ClassVar, Self

from core.errors import UsageError, choices
from core.geometry import Array
from core.goals.evidence import Evidence
from core.goals.keys import NEAR_ENOUGH, Key, Names
from core.goals.phrases import frame, vector
from core.goals.sites import Site, find_names, list_names
from core.scene import FIXTURE, Scene
from core.values.margins import Margin
from core.values.tools import Fixture

DONE = 1 - 1e-9  # a goal is fulfilled from this share on: 1, but for rounding
Given = Mapping[str, Any]
"""What an entry of a scene file's goals says."""


class Goal(ABC):
    """Something that a task wants.

    Goals are hints for programs: the reward is the task's own, or `goals_reward`. A model is told of them in words, an
    observer says by them what became of a body, and a margin says how close it was.

    A kind of goal is a class that says all of itself: how far it is fulfilled, its words, what it names in a scene, the
    keys that a scene file has it by, what is wrong with it or seldom meant, and what it wants of who plans.

    Attributes:
        keys: those of a scene file by which an entry wants a goal of this kind, or says more of it. A kind has those of
            the kind that it is made from, too; so it has `names`.
        names: the fields that name things of a scene, and which sort of things: `FREE_BODY`, `SOLID_BODY`, ...
        asks: what it asks, for a prompt: a template of ``goal``, with the functions of `core.goals.phrases`; of one to
            reach what follows its bodies.
        orients: whether it asks how bodies are turned.
    """

    keys: ClassVar[Mapping[str, Key]] = {}
    names: ClassVar[Mapping[str, str]] = {}
    asks: ClassVar[str] = ""
    orients: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        for said in ("keys", "names"):
            merged = dict[str, Any]()
            for kind in reversed(cls.__mro__):
                merged |= vars(kind).get(said, {})

            setattr(cls, said, merged)

    # What it measures:

    @abstractmethod
    def share(self, evidence: Evidence) -> Array:
        """Compute how far it was fulfilled, 0..1, (...).

        Raises:
            ValueError: it needs a trace, and there is none.
        """

    @abstractmethod
    def margins(self, evidence: Evidence) -> list[Margin]:
        """Return how far one world stayed from its limits, as far as that is a number."""

    def judge(self, evidence: Evidence) -> list[Margin]:
        """Return its margins, one of which is beyond its limit exactly where the goal is missed.

        What has no room is a yes or no: that a body is held, comes after another, or is where no tolerance is given.
        """
        margins = self.margins(evidence)
        if evidence.trace is None and self.needs_trace:
            return margins

        missed = bool(self.share(evidence) < DONE)
        if missed and all(margin.is_kept for margin in margins):
            margins.append(Margin.missed(_describe(self)))

        return margins

    @property
    def needs_trace(self) -> bool:
        """Whether its share depends on what happened before the end, or on what touched."""
        return False

    @property
    def needs_peaks(self) -> bool:
        """Whether it limits a force, so that each step of the engine has to be recorded."""
        return False

    @property
    def parts(self) -> tuple[Goal, ...]:
        """The goal itself, and what it also wants."""
        return (self,)

    # Its words:

    def words(self) -> str:
        """Say what it asks, see ``asks``; by default its kind and its fields."""
        if self.asks:
            from core.support.templates import fill_text  # imports Jinja

            return fill_text(self.asks, goal=self, vector=vector, frame=frame)

        said = [f"{name}={value!r}" for name, value in self.list_fields().items()]
        return f"{type(self).__name__}({', '.join(said)})"

    def list_fields(self) -> dict[str, Any]:
        """Return the fields that its kind has, with their values."""
        return vars(self)

    def describe(self) -> str:
        """Describe it for a prompt."""
        return self.words()

    # How a scene file says it:

    @classmethod
    def prepare(cls, given: Given) -> Given:
        """Rewrite what an entry of a scene file says, before its keys are looked at.

        Raises:
            ValueError: it has no sense.
        """
        return given

    @classmethod
    def translate(cls, key: str, given: Given) -> Given:
        """Return the fields that an entry does not have by their names.

        Args:
            key: for which it wants a goal of this kind.
            given: the whole entry.
        Raises:
            ValueError: it has no sense.
        """
        return {}

    @classmethod
    def read(cls, key: str, given: Given) -> Self:
        """Make the goal that a key of a scene file's entry stands for; for arguments see `translate`.

        Raises:
            ValueError: something is missing, or has no sense.
        """
        values = {"tolerance": NEAR_ENOUGH, **given, **cls.translate(key, given)}
        taken = [field for field in fields(cls) if field.init]  # type: ignore[arg-type]
        for field in taken:
            needed = field.default is MISSING and field.default_factory is MISSING
            if needed and field.name not in values:
                raise ValueError(f"a goal with {key!r} needs {field.name!r}, too")

        return cls(**{f.name: values[f.name] for f in taken if f.name in values})

    # In a scene:

    def list_named(self) -> Iterator[tuple[str, str]]:
        """Yield what the goal and its parts name in a scene: which sort of thing, and its name."""
        for part in self.parts:
            for field, what in part.names.items():
                for name in _listed(getattr(part, field)):
                    yield what, name

    @property
    def needs_fixture(self) -> bool:
        """Whether it names the fixture that a design brings (`core.design.Fixture`)."""
        return any(name == FIXTURE for _, name in self.list_named())

    def check_names(self, scene: Scene) -> None:
        """Refuse it where it names what a scene lacks.

        Raises:
            UsageError: names what is possible.
        """
        for what, name in self.list_named():
            _check_listed(what, name, scene)

    def resolve(self, site: Site) -> Self:
        """Return the goal with the names that its patterns fit, and what it needs to know of a scene.

        Raises:
            UsageError: it names what is not there, can never be met, or asks nothing.
        """
        found = self._name(site.scene).fit(site)
        found.check_names(site.scene)
        for fault in found.find_faults(site):
            raise UsageError(fault)

        return found

    def _name(self, scene: Scene) -> Self:
        """Return it with the names that its patterns fit.

        Raises:
            UsageError: a pattern fits none, or nothing has such a name.
        """
        found = {}
        for field, what in self.names.items():
            names = getattr(self, field)
            if isinstance(names, tuple):
                found[field] = names = find_names(names, list_names(what, scene))

            _check_listed(what, names, scene)

        return replace(self, **found)  # type: ignore[type-var]

    def fit(self, site: Site) -> Self:
        """Return it with what it needs to know of a scene, whose names it has."""
        return self

    def find_faults(self, site: Site) -> Iterator[str]:
        """Yield why it can never be met in a scene, or asks nothing."""
        yield from ()

    def find_fixture_fault(self, fixture: Fixture) -> str:
        """Say why it can't be met with what a design adds to the scene; empty: it can."""
        return ""

    def find_warnings(self, where: str, scene: Scene) -> Iterator[str]:
        """Yield a line for what is possible, and seldom meant; ``where`` names the goal."""
        yield from ()


@lru_cache(maxsize=64)
def _describe(goal: Goal) -> str:
    """Describe a goal; a process asks after each rollout that misses it."""
    return goal.describe()


def _listed(names: str | Names | None) -> Names:
    """Return what a field names; None: nothing."""
    if isinstance(names, str):
        return (names,)

    return names or ()


def _check_listed(what: str, names: str | Names | None, scene: Scene) -> None:
    """Refuse names that a scene does not have of a sort of things.

    Raises:
        UsageError: names what is possible.
    """
    possible = list_names(what, scene)
    for name in _listed(names):
        if name not in possible:
            raise choices(what, name, possible)

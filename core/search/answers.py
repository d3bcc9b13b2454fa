"""Read the designs of answers, and let the model look again at those that break a rule."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from core.design import Candidate, DesignError, Varied
from core.designs.curves import read_curve, vary
from core.designs.reading import dump_design, list_designs, read_designs
from core.designs.start import SpawnRules
from core.interfaces import Brief, Reply, Request
from core.values.plans import NO_PLAN

MAX_LOOKED_AT = 50
"""The most designs of an answer that are read to choose among them."""

_log = logging.getLogger(__name__)


def read_candidates(
    brief: Brief, designs: Sequence[Any], *, starts: bool
) -> list[Candidate]:
    """Read designs, at most as many as the brief asks for.

    Args:
        brief: of the request.
        designs: of the answer.
        starts: a tool that does not start clear of everything is faulty, too, before it is tried.
    """
    rules = SpawnRules(brief.task, brief.scene_seed) if starts else None
    return read_designs(
        {"strategies": designs},
        brief.representation,
        brief.task,
        base=Candidate(None, NO_PLAN, brief.generation, brief.agent),
        elites=tuple(elite.candidate.id for elite in brief.elites),
        most=(brief.n_tool, brief.n_action or None),
        actions=brief.actions,
        start=rules,
    )


def choose_designs(
    brief: Brief, designs: Sequence[Any], *, starts: bool
) -> Sequence[Any]:
    """Choose as many designs of an answer as its brief asks for: of more, those with a sound design go first.

    What is left out is said in a line.

    Args:
        brief: of the request.
        designs: of the answer, in its order.
        starts: see `read_candidates`.
    """
    wanted = brief.n_tool
    if len(designs) <= wanted:
        return designs

    def is_broken(number: int) -> bool:
        if number >= MAX_LOOKED_AT:
            return True
        found = read_candidates(brief, [designs[number]], starts=starts)
        return all(candidate.problem is not None for candidate in found)

    sound_first = sorted(range(len(designs)), key=is_broken)
    chosen = sorted(sound_first[:wanted])
    _log.warning(
        "an answer has %d designs for %d that were asked for: those that break a rule are left out first",
        len(designs),
        wanted,
    )
    return [designs[number] for number in chosen]


@dataclass(frozen=True, eq=False)
class Answer:
    """A request, and what came of it so far.

    Attributes:
        request: that was asked first.
        sent: that was sent last; asked for a second look, it is another one.
        designs: of the document that was read so far; empty: none.
        candidates: of these; at the end one in any case, if only one that says why there is no other.
        lost: there is no reply, for a reason that may pass.
    """

    request: Request
    sent: Request
    designs: Sequence[Any] = ()
    candidates: list[Candidate] = field(default_factory=list)
    lost: bool = False

    def read(self, document: object, mender: Mender | None) -> Answer:
        """Read the candidates of a reply's document; those of a second look are mended.

        Raises:
            DesignError: it holds no design.
        """
        brief = self.request.brief
        designs = list_designs(document)
        if self.candidates and mender is not None:
            return mender.mend(self, designs[: brief.n_tool])

        starts = mender is not None
        chosen = choose_designs(brief, designs, starts=starts)
        found = read_candidates(brief, chosen, starts=starts)
        return replace(self, designs=chosen, candidates=found)

    def with_curves(self) -> Answer:
        """Return it with the candidates of the curves that its designs ask for, numbered after its designs."""
        brief = self.request.brief
        found: list[Candidate] = []
        asked = self.designs if brief.curves and brief.n_action else ()
        for number, design in enumerate(asked):
            for candidate in self._make_curve(number, design):
                place = len(self.designs) + len(found)
                found.append(replace(candidate, design=place, action=0))

        return replace(self, candidates=[*self.candidates, *found])

    def _make_curve(self, number: int, design: Any) -> Iterator[Candidate]:
        """Yield the candidates of a design's curve, over its first sound plan."""
        brief = self.request.brief
        sound = [c for c in self.candidates if c.design == number and not c.problem]
        if not sound:
            return

        base = sound[0]
        try:
            axes = read_curve(design)
            varied = [*vary(base, axes, brief.curves)] if axes else []
        except DesignError as error:
            yield replace(base, problem=str(error), varied=Varied(base.id, (), ()))
            return

        for candidate in varied:
            written = dump_design(candidate, brief.representation)
            (read,) = read_candidates(brief, [written], starts=True)
            yield replace(
                candidate, tool=read.tool, plan=read.plan, problem=read.problem
            )

    def complete(self, problem: str) -> Answer:
        """Return it with a candidate that has a problem and stands for all, where there is none."""
        if self.candidates:
            return self

        brief = self.request.brief
        lost = Candidate(None, NO_PLAN, brief.generation, brief.agent, problem=problem)
        return replace(self, candidates=[lost])


class Mender(Protocol):
    """Has a model look again at what breaks a rule in its answer; a plugin makes it of a `PromptComposer`."""

    def look_again(self, answer: Answer, reply: Reply, problem: str) -> Request | None:
        """Compose the request for a second look; None: nothing in the answer breaks a rule.

        Args:
            answer: what was read so far.
            reply: that came last.
            problem: why the reply can't be read; empty: it can.
        """

    def mend(self, answer: Answer, designs: Sequence[Any]) -> Answer:
        """Put the designs of a second look in the places of the faulty ones."""

"""Send designs that break a rule back to the model, with all their faults, and put the mended ones in their places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from core.design import Candidate, DesignError
from core.designs.composer import PromptComposer
from core.designs.planning import NO_PLAN
from core.designs.reading import list_strategies, read_designs
from core.designs.schema import answer_schema
from core.designs.start import SpawnRules
from core.designs.tools import read_fields
from core.interfaces import Brief, Reply, Request

REPAIRED = "-repair"  # at the end of the id of a request that asks once more


def read_candidates(
    brief: Brief, strategies: Sequence[Any], *, starts: bool
) -> list[Candidate]:
    """Read strategies, at most as many as the brief asks for.

    Args:
        brief: of the request.
        strategies: of the answer.
        starts: a tool that does not start clear of everything is faulty, too, before it is tried.
    """
    rules = SpawnRules(brief.task, brief.scene_seed) if starts else None
    return read_designs(
        {"strategies": strategies},
        brief.representation,
        brief.task,
        base=Candidate(None, NO_PLAN, brief.generation, brief.agent),
        elites=tuple(elite.candidate.id for elite in brief.elites),
        most=(brief.n_tool, brief.n_action or None),
        actions=brief.actions,
        start=rules,
    )


def list_faults(candidates: Sequence[Candidate]) -> list[str]:
    """Say what is wrong with the designs of an answer, a line for each fault, with the number of its strategy."""
    faults = {
        f"strategy {candidate.strategy + 1}: {candidate.problem}": None
        for candidate in candidates
        if candidate.problem is not None
    }
    return list(faults)


@dataclass(frozen=True, eq=False)
class Answer:
    """A request, and what came of it so far.

    Attributes:
        request: that was asked first.
        sent: that was sent last; asked for a second look, it is another one.
        strategies: of the document that was read so far; empty: none.
        candidates: of these; at the end one in any case, if only one that says why there is no other.
        lost: there is no reply, for a reason that may pass.
    """

    request: Request
    sent: Request
    strategies: Sequence[Any] = ()
    candidates: list[Candidate] = field(default_factory=list)
    lost: bool = False

    def complete(self, problem: str) -> Answer:
        """Return it with a candidate that has a problem and stands for all, where there is none."""
        if self.candidates:
            return self

        brief = self.request.brief
        lost = Candidate(None, NO_PLAN, brief.generation, brief.agent, problem=problem)
        return replace(self, candidates=[lost])

    def faulty(self) -> list[int]:
        """Return the numbers of the strategies that hold a design that breaks a rule."""
        return sorted({c.strategy for c in self.candidates if c.problem is not None})

    def look_again(self, prompts: PromptComposer, reply: Reply, problem: str) -> Answer:
        """Compose the request for a second look: at the faulty designs, or at all where the reply has a ``problem``."""
        brief = self.request.brief
        numbers = self.faulty()
        if numbers:
            brief = replace(brief, n_tool=len(numbers))

        faults = list_faults(self.candidates)
        sent = replace(
            self.request,
            id=f"{self.sent.id}{REPAIRED}",
            brief=brief,
            messages=prompts.repair(self.request, reply, problem, faults, brief),
            schema=answer_schema(brief),
        )
        return replace(self, sent=sent)

    def read(self, document: object, *, starts: bool) -> Answer:
        """Read the candidates of an answer; mended ones take their old places. ``starts``: see `read_candidates`.

        Raises:
            DesignError: it holds no strategy.
        """
        # A reply may hold more than were asked for, which are not read.
        strategies = list_strategies(document)[: self.request.brief.n_tool]
        if self.candidates:
            return self._mend(strategies)

        found = read_candidates(self.request.brief, strategies, starts=starts)
        return replace(self, strategies=strategies, candidates=found)

    def _mend(self, answered: Sequence[Any]) -> Answer:
        """Put the designs of an answer in the places of the faulty ones, under the same names.

        What an answer leaves out of a strategy stays as it was. A tool that was sound stays with all of its plans.

        ``answered`` has a strategy for each that was faulty, or for all.
        """
        numbers = self.faulty()
        if len(answered) == len(self.strategies):
            answered = [answered[number] for number in numbers]

        strategies = list(self.strategies)
        merged: list[Any] = []
        for number, new in zip(numbers, answered, strict=False):
            strategies[number] = self._merge(number, new)
            merged.append(strategies[number])

        mended = list(self.candidates)
        found = read_candidates(self.request.brief, merged, starts=True)
        for place, number in enumerate(numbers[: len(merged)]):
            new = [candidate for candidate in found if candidate.strategy == place]
            mended = _replace(mended, number, new)

        return replace(self, strategies=strategies, candidates=mended)

    def _merge(self, number: int, new: object) -> object:
        """Put a new strategy over an old one, field by field; a tool that is sound stays."""
        representation = self.request.brief.representation
        kept: dict[str, Any] = {}
        for candidate in self.candidates:
            if candidate.strategy == number and candidate.problem is None:
                assert candidate.tool is not None
                kept = representation.dump(candidate.tool)
                kept["gripper"] = candidate.tool.gripper

        try:
            old = read_fields(self.strategies[number], representation)
            return {**old, **read_fields(new, representation), **kept}
        except DesignError:  # one of them is read alone, and its fault said
            return new


def _replace(
    candidates: list[Candidate], number: int, new: list[Candidate]
) -> list[Candidate]:
    """Replace the faulty candidates of a strategy by new ones: all of them, or plan by plan where others are sound.

    Args:
        candidates: of the answer.
        number: of the strategy.
        new: what was read of the second look.
    """
    old = [candidate for candidate in candidates if candidate.strategy == number]
    sound = [candidate for candidate in old if candidate.problem is None]
    faulty = [candidate for candidate in old if candidate.problem is not None]

    if sound:
        if len(new) > len(faulty):  # it repeats those that are sound
            actions = {candidate.action for candidate in faulty}
            new = [candidate for candidate in new if candidate.action in actions]

        faulty = faulty[: len(new)]
        new = [
            replace(fresh, tool=sound[0].tool, action=broken.action)
            for broken, fresh in zip(faulty, new, strict=False)
        ]

    if not new:
        return candidates

    others = [candidate for candidate in candidates if candidate not in faulty]
    mended = [replace(candidate, strategy=number) for candidate in new]
    return sorted([*others, *mended], key=lambda candidate: candidate.key)

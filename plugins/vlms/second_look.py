"""Send designs that break a rule back to the model, with all their faults, and put the mended ones in their places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from core.design import Candidate, DesignError
from core.designs.composer import PromptComposer
from core.designs.schema import answer_schema
from core.designs.tool_fields import read_fields
from core.interfaces import Message, Reply, Request, Text
from core.search.answers import Answer, read_candidates

REPAIR = "repair"  # the template
MAX_REPEATED = 400_000  # characters of a reply that are sent back


def list_faults(candidates: Sequence[Candidate]) -> list[str]:
    """Say what is wrong with the designs of an answer, a line for each fault, with its design's number."""
    faults = {
        f"design {candidate.design + 1}: {candidate.problem}": None
        for candidate in candidates
        if candidate.problem is not None
    }
    return list(faults)


def list_faulty(candidates: Sequence[Candidate]) -> list[int]:
    """Return the numbers of the designs that hold a design that breaks a rule."""
    faulty = {c.design for c in candidates if c.problem is not None}
    return sorted(faulty)


@dataclass(frozen=True, eq=False)
class SecondLook:
    """Sends the faulty designs of an answer back, with their faults: a `core.search.answers.Mender`."""

    prompts: PromptComposer

    def __post_init__(self) -> None:
        self.prompts.templates.load(REPAIR)

    def look_again(self, answer: Answer, reply: Reply, problem: str) -> Request | None:
        """Compose the request for a second look: at the faulty designs, or at all where the reply has a ``problem``."""
        numbers = list_faulty(answer.candidates)
        if reply.cut_by or not (numbers or problem):
            return None  # a reply that was cut off would be cut off again

        request = answer.request
        brief = request.brief
        if numbers:
            brief = replace(brief, n_tool=len(numbers))

        faults = list_faults(answer.candidates)
        return replace(
            request,
            id=f"{answer.sent.id}-repair",
            purpose="repairs",
            brief=brief,
            messages=self._compose(
                replace(request, brief=brief), reply, problem, faults
            ),
            schema=answer_schema(brief),
        )

    def _compose(
        self, request: Request, reply: Reply, problem: str, faults: Sequence[str]
    ) -> tuple[Message, ...]:
        """Compose the messages of a request, the reply, and a request to mend it.

        Args:
            request: that was answered; its brief is of what is to be mended.
            reply: to it.
            problem: why the reply can't be read; empty: it can.
            faults: of its designs.

        Raises:
            UserError: the template fails.
        """
        brief = request.brief
        sight = self.prompts.facts.level.sight(brief.task, brief.scene_seed)
        values = {
            "problem": sight.text(problem),
            "faults": [sight.text(fault) for fault in faults],
            "brief": brief,
        }
        messages = list(request.messages)
        text = reply.text[:MAX_REPEATED]
        if text.strip():
            messages.append(Message("assistant", (Text(text),)))
        asked = self.prompts.templates.fill(REPAIR, values)
        messages.append(Message("user", (asked,)))

        return tuple(messages)

    def mend(self, answer: Answer, designs: Sequence[Any]) -> Answer:
        """Put the designs of a second look in the places of the faulty ones, under the same names.

        What it leaves out of a design stays as it was. A tool that was sound stays with all of its plans.

        Args:
            answer: what was read before.
            designs: one for each that was faulty, or for all.
        """
        numbers = list_faulty(answer.candidates)
        if len(designs) == len(answer.designs):
            designs = [designs[number] for number in numbers]

        whole = list(answer.designs)
        merged: list[Any] = []
        for number, new in zip(numbers, designs, strict=False):
            whole[number] = _merge(answer, number, new)
            merged.append(whole[number])

        mended = list(answer.candidates)
        found = read_candidates(answer.request.brief, merged, starts=True)
        for place, number in enumerate(numbers[: len(merged)]):
            new = [candidate for candidate in found if candidate.design == place]
            mended = _replace(mended, number, new)

        return replace(answer, designs=whole, candidates=mended)


def _merge(answer: Answer, number: int, new: object) -> object:
    """Put a new design over an old one, field by field; a tool that is sound stays."""
    representation = answer.request.brief.representation
    kept: dict[str, Any] = {}
    for candidate in answer.candidates:
        if candidate.design == number and candidate.problem is None:
            assert candidate.tool is not None
            kept = representation.dump(candidate.tool)
            kept["gripper"] = candidate.tool.gripper

    try:
        old = read_fields(answer.designs[number], representation)
        return {**old, **read_fields(new, representation), **kept}
    except DesignError:  # one of them is read alone, and its fault said
        return new


def _replace(
    candidates: list[Candidate], number: int, new: list[Candidate]
) -> list[Candidate]:
    """Replace the faulty candidates of a design by new ones: all of them, or plan by plan where others are sound.

    Args:
        candidates: of the answer.
        number: of the design.
        new: what was read of the second look.
    """
    old = [candidate for candidate in candidates if candidate.design == number]
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
    mended = [replace(candidate, design=number) for candidate in new]
    return sorted([*others, *mended], key=lambda candidate: candidate.key)

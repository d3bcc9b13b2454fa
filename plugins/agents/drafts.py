"""Read the designs that an agent's calls name, whole or by what changes, and say what is wrong with them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from core.design import Candidate, DesignError, Tool
from core.designs.reading import dump_design, list_designs
from core.designs.replies import parse_reply
from core.scene import Scene
from core.search.answers import read_candidates
from core.simulation.checking import find_problems
from core.support.text import by_reason
from core.values.plans import Anchor
from plugins.agents.arguments import OfDesigns, read_text
from plugins.agents.bench import Refused
from plugins.agents.editing import change_design
from plugins.agents.session import Session


@dataclass(frozen=True)
class _Emptied:
    """Takes all out of a scene: what is said of it then measures nothing in it."""

    number: int = 0

    def __call__(self, scene: Scene) -> Scene:
        return replace(scene, bodies=(), joints=(), bonds=())

    def perturb_tool(self, tool: Tool) -> Tool:
        return tool


def write_document(session: Session, asked: OfDesigns) -> str:
    """Return the text of the designs document that a call names.

    Raises:
        Refused: it names none, or two, or changes what is not there.
    """
    if (asked.designs is None) == (asked.candidate is None):
        raise Refused("designs: give a document, or else candidate and change")
    if asked.designs is not None:
        if asked.change:
            raise Refused("change goes with candidate, not with designs")
        return read_text(asked.designs)

    assert asked.candidate is not None
    design = write_design(session, session.find(asked.candidate).candidate)
    changed = change_design(design, asked.change)
    return read_text({"strategies": [changed]})


def write_design(session: Session, candidate: Candidate) -> dict[str, Any]:
    """Write a candidate that was tried as a design, of which it is a parent.

    Raises:
        Refused: it has no tool.
    """
    if candidate.tool is None:
        raise Refused(f"{candidate.id} has no tool that could be read")
    design = dump_design(candidate, session.brief_reading().representation)
    design["parents"] = [candidate.id]
    return design


def read_document(
    session: Session, text: str, *, starts: bool = True
) -> list[Candidate]:
    """Read the candidates of a designs document, with the rule that each breaks, if any.

    Args:
        session: the search.
        text: the document.
        starts: a tool that does not start clear of everything breaks a rule.

    Raises:
        Refused: it can't be read, or holds more than a call may.
    """
    brief = session.brief_reading()
    try:
        designs = list_designs(parse_reply(text))
    except DesignError as error:
        raise Refused(f"designs: {error}") from error

    plans = [
        len(design["action_sets"])
        for design in designs
        if isinstance(design, dict) and isinstance(design.get("action_sets"), list)
    ]
    # Else a part of them would not be read.
    if len(designs) > brief.n_tool or max(plans, default=0) > brief.n_action:
        raise Refused(
            f"designs: a call holds at most {brief.n_tool} tools with {brief.n_action} plans each"
        )
    return read_candidates(brief, designs, starts=starts)


def name_draft(candidate: Candidate) -> str:
    """Name a candidate of a document by its place there."""
    return f"design {candidate.design + 1}, plan {candidate.action + 1}"


def say_refusal(session: Session, candidate: Candidate) -> str:
    """Say why a candidate is refused, in words and in codes; without codes where something is not told."""
    problem = candidate.problem or ""
    said = session.describer.clean(problem)
    if said != problem:
        return said
    return " ".join([said, *(f"[{refusal}]" for refusal in candidate.refusals)])


def say_problems(session: Session, candidate: Candidate) -> str:
    """Say what is wrong with a candidate in the layouts of the search, on one line; empty: nothing was found."""
    if candidate.problem is not None:
        return say_refusal(session, candidate)
    conditions = session.conditions
    if session.unseen:
        if any(anchor != Anchor() for anchor in candidate.plan.anchors):
            return ""
        conditions = [replace(conditions[0], change=_Emptied())]

    found = [
        (f"layout {condition.layout}", session.describer.clean(problem))
        for condition in conditions
        for problem in find_problems(condition, candidate)
    ]
    if len(conditions) == 1:
        return "; ".join(dict.fromkeys(problem for _, problem in found))
    return "; ".join(map(str, by_reason(found)))

"""Write the ledger of a run: of each design its idea, what it changed, and what came of that, in a line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from core.design import Tool
from core.designs.prompt_values import RunFacts
from core.interfaces import Brief, Evaluation
from core.support.text import clean, number, short_numbers
from core.trial import best_first
from core.values.observations import Sight
from plugins.vlms.context.changes import describe_change
from plugins.vlms.context.feedback import name_design

MOST = 3_000
"""Characters of the ledger, some 1,300 tokens; what is left out is counted."""

_IDEA = 150  # characters of an idea
_CHANGE = 160  # characters of a change


def ledger_value(brief: Brief, mounted: Tool, facts: RunFacts) -> str:
    """Write the ledger for templates, their ``ledger``; empty: nothing was tried, or elites are shown as in the paper.

    Args:
        brief: which has what was tried.
        mounted: the tool on the arm, which no line says anything of.
        facts: of the run: the settings of prompts, and the level at which bodies are described.
    """
    if facts.settings.feedback == "paper":
        return ""

    sight = facts.level.sight(brief.task, brief.scene_seed)
    return "\n".join(ledger_lines(brief.tried, sight))


def ledger_lines(tried: Iterable[Evaluation], sight: Sight) -> list[str]:
    """Write a line for each design, the first generation first; where there are too many, for the best of them.

    Args:
        tried: all candidates of a run so far.
        sight: what may be said of bodies.
    """
    known = {evaluation.candidate.id: evaluation for evaluation in tried}
    others = [e for e in known.values() if e.status != "ok"]
    designs: dict[str, list[Evaluation]] = {}
    for evaluation in (*best_first(known.values()), *others):
        designs.setdefault(evaluation.candidate.idea, []).append(evaluation)

    lines: dict[tuple[int, ...], str] = {}
    left = MOST
    for alike in designs.values():
        line = _describe(alike[0], known, sight) + describe_curve(alike)
        left -= len(line) + 1
        if left < 0:
            break
        lines[alike[0].candidate.key] = line

    written = [lines[key] for key in sorted(lines)]
    hidden = len(designs) - len(lines)
    return [*written, f"- {hidden} more designs earned less"] if hidden else written


def _describe(
    evaluation: Evaluation, known: Mapping[str, Evaluation], sight: Sight
) -> str:
    """Write the line of a design: its best plan stands for it."""
    candidate = evaluation.candidate
    parents = [known[name] for name in candidate.parents if name in known]
    head = f"- {name_design(evaluation)}"
    idea = clean(candidate.design_description, _IDEA)
    came = sight.text(_say_outcome(evaluation))
    if not parents:
        return f"{head}: {idea} | {came}"

    before = parents[0]
    change = clean(describe_change(before.candidate, candidate), _CHANGE)
    was = _say_outcome(before)
    return f"{head} from {before.candidate.id}: {idea} | {change} | {sight.text(was)} -> {came}"


def describe_curve(evaluations: Iterable[Evaluation]) -> str:
    """Say what came of the designs of a curve, in the order of what was added; empty: none are of one.

    Args:
        evaluations: of a design and its curve.
    """
    points = []
    names: tuple[str, ...] = ()
    for evaluation in evaluations:
        varied = evaluation.candidate.varied
        if varied is not None and varied.added:
            names = varied.names
            points.append((varied.added, _say_outcome(evaluation, reason=False)))

    if not points:
        return ""

    said = [f"{short_numbers(added, 3, '/')}: {came}" for added, came in sorted(points)]
    return f" | curve, added to {' / '.join(names)}: {'; '.join(said)}"


def _say_outcome(evaluation: Evaluation, *, reason: bool = True) -> str:
    """Say what a design earned, and how much room it left; or why it could not be tried, with its ``reason``."""
    if evaluation.status != "ok":
        why = f": {clean(evaluation.reason, 80)}" if reason else ""
        return f"{evaluation.status}{why}"

    earned = number(evaluation.reward, 3)
    least = evaluation.least_margin
    if least is None or evaluation.reason:
        return earned
    return f"{earned}, room {100 * least.margin:.0f} %"

"""Write the ledger of a run: of each design its idea, what it changed, and what came of that, in a line."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from operator import itemgetter

from core.design import Tool
from core.designs.prompt_values import RunFacts
from core.interfaces import Brief, Evaluation
from core.support.text import clean, short_numbers
from core.trial import best_first
from core.values.observations import Sight
from plugins.vlms.context.changes import describe_change
from plugins.vlms.context.feedback import name_design
from plugins.vlms.context.phrases import phrase

MOST = 3_000
"""Characters of the ledger, some 1,300 tokens; what is left out is counted."""


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
        line = _write_line(alike, known, sight)
        left -= len(line) + 1
        if left < 0:
            break
        lines[alike[0].candidate.key] = line

    written = [lines[key] for key in sorted(lines)]
    hidden = len(designs) - len(lines)
    return [*written, f"- {hidden} more designs earned less"] if hidden else written


def _write_line(
    alike: Sequence[Evaluation], known: Mapping[str, Evaluation], sight: Sight
) -> str:
    """Write the line of a design: its best plan stands for it, and its curve follows.

    Args:
        alike: the plans of the design, the best first.
        known: all candidates, by their ids.
        sight: what may be said of bodies.
    """
    best = alike[0]
    parents = [known[name] for name in best.candidate.parents if name in known]
    before = parents[0] if parents else None
    change = ""
    if before is not None:
        change = describe_change(before.candidate, best.candidate)

    curve = []
    for evaluation in alike:
        varied = evaluation.candidate.varied
        if varied is not None and varied.added:
            curve.append((varied.added, evaluation))
    curve.sort(key=itemgetter(0))

    name = name_design(best)
    told = (name, best, before, change, [evaluation for _, evaluation in curve])
    return phrase("ledger", "line", *told, sight, clean, short_numbers)

"""Texts of a recording. A model's text is shown as plain text, never as Markdown, which can fetch pictures and hide
the targets of links.
"""

from __future__ import annotations

from collections.abc import Sequence

from core.design import Candidate, Evaluation
from core.support.text import clean

MAX_NAME = 200
MAX_TEXT = 4000
_INDENT = "    "  # before every line of a model's, so that it can't be taken for one of ours


def design_text(evaluation: Evaluation, replayed: float | None, note: str = "") -> str:
    """The text beside a candidate; ``replayed`` is the reward of the recorded rollout."""
    candidate = evaluation.candidate
    lines = [
        f"candidate {candidate.id}, reward {evaluation.reward:.3f}, distance {evaluation.distance_m:.2f} m",
        _descent(candidate),
    ]
    if replayed is not None and abs(replayed - evaluation.reward) > 1e-6:
        lines.append(f"the recorded rollout earned {replayed:.3f}")
    lines += [note] if note else []
    tool = candidate.tool
    if tool is not None and tool.components:
        lines += ["", "tool, in the model's words:", *_quoted(tool.name, tool.description)]
    lines += ["", "strategy, in the model's words:", *_quoted(candidate.strategy_name, candidate.strategy_description)]
    if candidate.action_description:
        lines += ["", "motion, in the model's words:", *_quoted(candidate.action_description)]
    if tool is not None and tool.components:
        lines += ["", "components:"]
        for component in tool.components:
            name, parent = clean(component.name, MAX_NAME), clean(component.parent, MAX_NAME)
            lines.append(f"{_INDENT}{name} on {parent}, {1000 * component.mass:.0f} g")
    return "\n".join(lines) + "\n"


def tools_text(ranked: Sequence[Evaluation], reward_save: float) -> str:
    """The text beside a generation's best tools; those that earned more than ``reward_save`` are elites."""
    lines = []
    for rank, evaluation in enumerate(ranked, start=1):
        candidate = evaluation.candidate
        elite = "an elite" if evaluation.reward > reward_save else "no elite"
        lines.append(
            f"{rank}: {elite}, candidate {candidate.id}, reward {evaluation.reward:.3f}, {_descent(candidate)}"
        )
        if candidate.tool is not None:
            lines += [*_quoted(candidate.tool.name, candidate.tool.description), ""]
    return "\n".join(lines) + "\n"


def _descent(candidate: Candidate) -> str:
    match candidate.parents:
        case ():
            return "a fresh design"
        case (parent,):
            return f"a mutation of {parent}"
        case parents:
            return f"a crossover of {' and '.join(parents)}"


def _quoted(*texts: str) -> list[str]:
    lines = [line for text in texts for line in clean(text, MAX_TEXT, lines=True).splitlines()]
    return [f"{_INDENT}{line}" for line in lines] or [f"{_INDENT}(nothing)"]

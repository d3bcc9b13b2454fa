"""Say in which further layouts all fail that were tried there, and what those layouts have in common."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from core.design import Tool
from core.designs.prompt_values import RunFacts
from core.interfaces import Brief, Evaluation, Task, Trial
from core.support.text import clean

_LEAST = 2  # candidates that fail in a layout, before it is the layout that is hard
_FEW_LAYOUTS = 2  # in so many, numbers are near each other by chance
_OUTCOMES = 2
_OUTCOME = 100  # characters
_NUMBERS = 4
_NARROW = 0.3  # of a range; numbers within less have their value in common

Hard = Mapping[int, Sequence[Trial]]
"""The trials in layouts in which all fail, by the layout's seed."""


def hard_layouts_value(brief: Brief, mounted: Tool, facts: RunFacts) -> list[str]:
    """Return lines for templates, their ``hard_layouts``; none: there is no such layout."""
    task = brief.task
    if len(task.parts) > 1:
        return []

    hard = find_hard_layouts((*brief.tried, *brief.elites))
    if not hard:
        return []

    sight = facts.level.sight(task, brief.scene_seed)
    lines = _outcomes(hard)
    if sight.numbers:
        lines += _common_numbers(hard, task)

    return [sight.text(line) for line in lines]


def find_hard_layouts(evaluations: Iterable[Evaluation]) -> Hard:
    """Return the further layouts in which several candidates were tried and none solved it."""
    tallies = {e.candidate.content: e.finals for e in evaluations if e.finals.count}
    tried: dict[int, dict[str, list[Trial]]] = {}
    for content, tally in tallies.items():
        for trial in tally.in_order():
            if trial.where.change is not None:  # of one layout
                continue
            by_candidate = tried.setdefault(trial.layout, {})
            by_candidate.setdefault(content, []).append(trial)

    hard: dict[int, list[Trial]] = {}
    for layout, by_candidate in sorted(tried.items()):
        worst = [
            min(trials, key=lambda t: t.reward) for trials in by_candidate.values()
        ]
        if len(worst) >= _LEAST and not any(trial.solved for trial in worst):
            hard[layout] = worst

    return hard


def _outcomes(hard: Hard) -> list[str]:
    """Say how many layouts there are, and what became of the trials."""
    trials = [trial for tried in hard.values() for trial in tried]
    outcomes = [t.reason or t.outcome or f"reward {t.reward:.1f}" for t in trials]
    counts = Counter(clean(outcome, _OUTCOME) for outcome in outcomes)

    plural = "s" if len(hard) > 1 else ""
    lines = [f"layout{plural} {', '.join(map(str, hard))}"]
    for outcome, count in counts.most_common(_OUTCOMES):
        lines.append(f"{outcome} (in {count} of {len(trials)} trials)")

    return lines


def _common_numbers(hard: Hard, task: Task) -> list[str]:
    """Say which of the numbers that are drawn lie near each other, of their ranges the nearest first."""
    found = []
    for name, (low, high) in task.ranges.items():
        values = [task.draw(layout)(name, math.nan) for layout in hard]
        least = min(values)
        most = max(values)
        narrow = _NARROW * (high - low)
        # With few layouts, only values at an end of the range say more than chance.
        is_telling = len(values) > _FEW_LAYOUTS
        is_telling = is_telling or most < low + narrow or least > high - narrow
        if is_telling and most - least < narrow:
            line = (
                f"{name} is {least:.4g} to {most:.4g} there, of {low:.4g} to {high:.4g}"
            )
            found.append(((most - least) / (high - low), line))

    return [line for _, line in sorted(found)[:_NUMBERS]]

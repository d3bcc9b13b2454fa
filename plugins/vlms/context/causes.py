"""Say why a design fails in further layouts: the commonest causes, and which way and how far bodies missed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from core.interfaces import Evaluation, Trial
from core.support.text import clean, hide_numbers, number
from core.values.observations import Offset, Sight
from plugins.vlms.context.phrases import phrase

_CAUSES = 3  # of an elite
_LAYOUTS = 4  # that are named for a cause
_LONGEST = 100  # characters of a cause
_FREE: Offset = (None, None, None)


def cause_lines(evaluation: Evaluation, sight: Sight) -> list[str]:
    """Say why a candidate fails in further layouts: a line for each of the commonest causes.

    Args:
        evaluation: of a candidate that was tried in some.
        sight: what may be said of bodies.
    """
    failed = failing_trials(evaluation)
    groups: dict[str, list[Trial]] = {}
    for trial in failed:
        groups.setdefault(hide_numbers(_cause_of(trial)), []).append(trial)

    commonest = sorted(groups.values(), key=len, reverse=True)
    lines = [_describe(group, len(failed), sight) for group in commonest[:_CAUSES]]
    left = sum(len(group) for group in commonest[_CAUSES:])
    return [*lines, f"other causes in {left} of them"] if left else lines


def failing_trials(evaluation: Evaluation) -> list[Trial]:
    """Return a candidate's trials in the further layouts where it does not hold, of each its worst, the worst first."""
    failed = []
    for trials in evaluation.finals.trials.values():
        unsolved = [trial for trial in trials if not trial.solved]
        if unsolved:
            failed.append(min(unsolved, key=lambda trial: trial.reward))

    return sorted(failed, key=lambda trial: (trial.reward, number_of(trial)))


def number_of(trial: Trial) -> int:
    """Return the number of a further layout: its seed's or, of a change of the scene in one layout, the change's."""
    change = trial.where.change
    return trial.layout if change is None else change


def name_further(trials: Iterable[Trial]) -> str:
    """Say what trials that decide between the best were made in: layouts, or changes of one."""
    is_changed = all(trial.where.change is not None for trial in trials)
    return "change" if is_changed else "layout"


def _cause_of(trial: Trial) -> str:
    """Name the cause for which a trial earns less."""
    return clean(trial.cause, _LONGEST) or f"reward {number(trial.reward, 2)}"


def _describe(group: Sequence[Trial], count: int, sight: Sight) -> str:
    """Say a cause, in how many of so many layouts, and how far bodies missed there."""
    numbers = sorted(map(number_of, group))
    listed = ", ".join(map(str, numbers[:_LAYOUTS]))
    if len(numbers) > _LAYOUTS:
        listed += ", ..."
    plural = "s" if len(group) > 1 else ""
    places = f"{name_further(group)}{plural} {listed}"

    offsets = [offset for trial in group for offset in _list_offsets(trial)]
    missed = _summarize(offsets) if offsets else ()

    cause = sight.text(_cause_of(group[0]))
    where = (len(group), count, places)
    return phrase("observed", "cause", cause, *where, missed, sight.numbers)


def _summarize(offsets: Sequence[Offset]) -> tuple[Offset, float, float]:
    """Return the mean offset, and the least and the most distance; an axis that no goal asks for is None in all."""
    ways = np.array(offsets, dtype=float)  # None becomes nan
    is_free = np.isnan(ways).all(axis=0)
    x, y, z = (
        None if free else float(np.nanmean(way))
        for free, way in zip(is_free, ways.T, strict=True)
    )
    lengths = np.sqrt(np.nansum(ways**2, axis=1))
    return (x, y, z), float(lengths.min()), float(lengths.max())


def _list_offsets(trial: Trial) -> list[Offset]:
    """List how far the goal's bodies that are not in place ended off it, along the axes of their goals."""
    seen = trial.observation
    if seen is None:
        return []

    found = [seen.errors.get(name, _FREE) for name in seen.left]
    return [offset for offset in found if offset != _FREE]

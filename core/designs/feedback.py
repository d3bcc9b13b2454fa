"""Write what was observed of rollouts for a prompt: a line for each candidate of a generation, more for elites."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import zip_longest
from typing import Any

import numpy as np

from core.interfaces import Brief, Contact, Observation, Task
from core.support.text import by_reason, clean, short_numbers
from core.trial import Evaluation, Trial, best_first
from core.values.observations import Sight

_MISS_M, _MISS_RAD, _LAG_RAD, _MOVED_M, _DEEP_M = (
    0.001,
    0.01,
    0.01,
    0.001,
    0.001,
)  # what is less is not worth its words
_CONTACTS, _BODIES, _LAYOUTS, _OUTCOMES = 8, 4, 3, 6  # of an elite, at most
_IN_A_LINE = 2  # bodies, and touches
_REASON, _NAME, _OUTCOME = 300, 120, 100  # characters
_REASONS = 3  # of candidates without a line of their own
ALL = Sight()


def last_generation(tried: Iterable[Evaluation]) -> tuple[Evaluation, ...]:
    """Return the evaluations of the last generation among those that were tried, in the order of `Candidate.key`."""
    tried = list(tried)
    last = max((e.candidate.generation for e in tried), default=0)
    return tuple(
        sorted(
            (e for e in tried if e.candidate.generation == last),
            key=lambda e: e.candidate.key,
        )
    )


def outcome_of(evaluation: Evaluation) -> str:
    """Name what became of a candidate: its class (`Observation.result`), ``rejected``, ``failed`` or ``invalid``."""
    if evaluation.status != "ok":
        return evaluation.status
    if evaluation.reason:
        return "invalid"
    seen = evaluation.observation
    return seen.result if seen is not None else "tried"


def most_instructive(evaluations: Iterable[Evaluation]) -> Evaluation | None:
    """Choose the failure that most is learnt from; None: there is none that was tried.

    It is the best candidate of the most frequent class of failure; of equally frequent ones the one that got farther.
    """
    return next(iter(_failures(evaluations)), None)


def most_telling(
    elites: Sequence[Evaluation], evaluations: Iterable[Evaluation]
) -> Iterator[Evaluation]:
    """Yield candidates from which most is learnt: the best elite, the most instructive failure, the next of each..."""
    names = {elite.candidate.id for elite in elites}
    failures = _failures(e for e in evaluations if e.candidate.id not in names)
    for pair in zip_longest(elites, failures):
        yield from filter(None, pair)


def critiques_text(brief: Brief) -> str:
    """Write the critiques in a brief, of its elites and of what was tried, as JSON; empty: there are none."""
    known = {e.candidate.id: e for e in (*brief.tried, *brief.elites)}
    entries = []
    for name, text in brief.critiques.items():
        tool = known[name].candidate.tool
        named = (
            {"tool_name": clean(tool.name, _NAME)}
            if tool is not None and tool.name
            else {}
        )
        entries.append(
            {
                "id": name,
                "reward": round(known[name].reward, 4),
                **named,
                "critique": text,
            }
        )
    return json.dumps(entries, indent=1, ensure_ascii=False) if entries else ""


def _failures(evaluations: Iterable[Evaluation]) -> list[Evaluation]:
    """The best candidate of each class of failure, the most frequent class first."""
    groups: dict[str, list[Evaluation]] = {}
    for evaluation in best_first(evaluations):
        if (what := outcome_of(evaluation)) not in ("solved", "placed"):
            groups.setdefault(what, []).append(evaluation)
    ordered = sorted(
        groups.values(), key=lambda group: (len(group), group[0].reward), reverse=True
    )
    return [group[0] for group in ordered]


@lru_cache(maxsize=2)
def generation_lines(
    evaluations: tuple[Evaluation, ...], budget: int, sight: Sight = ALL
) -> str:
    """Write a line for each candidate, in about ``budget`` characters.

    Candidates with equal lines share one. Where they would be too long, each kind keeps as many of its best as the
    others, and the last line counts what is left out.
    """
    groups: dict[str, list[Evaluation]] = {}
    others = sorted(
        (e for e in evaluations if e.status != "ok"),
        key=lambda e: (e.status, e.candidate.key),
    )
    for evaluation in (*best_first(evaluations, tie=0.0), *others):
        groups.setdefault(describe(evaluation, sight), []).append(evaluation)

    kinds: dict[str, list[str]] = {}
    for text, group in groups.items():
        kinds.setdefault(outcome_of(group[0]), []).append(text)
    lines = {text: f"- {_ids(group)}: {text}" for text, group in groups.items()}
    shown: set[str] = set()
    for text in (
        text
        for rank in zip_longest(*kinds.values())
        for text in rank
        if text is not None
    ):
        budget -= len(lines[text]) + 1
        if budget < 0 and shown:
            break
        shown.add(text)

    rest = [
        evaluation
        for text, group in groups.items()
        if text not in shown
        for evaluation in group
    ]
    written = [line for text, line in lines.items() if text in shown]
    if rest:
        counts = ", ".join(
            f"{count} {name}"
            for name, count in Counter(map(outcome_of, rest)).most_common()
        )
        reasons = by_reason((e.candidate.id, e.reason) for e in rest)[:_REASONS]
        why = (sight.text(clean(reason, _OUTCOME)) for reason in reasons)
        written.append(
            f"- Left out: {'; '.join([f'{len(rest)} candidates: {counts}', *why])}."
        )
    return "\n".join(written)


def combined_figures(
    evaluation: Evaluation, task: Task, sight: Sight = ALL
) -> dict[str, Any]:
    """Describe what a fitness made of several trials, as JSON: the same for the same trials, however long they took."""
    figures: dict[str, Any] = {}
    if evaluation.combined:
        figures["trials"] = trial_lines(evaluation, sight)
        figures["engines"] = {
            engine: statistics(rewards)
            for engine, rewards in evaluation.by_engine.items()
        }
        figures["poor_layouts"] = (
            poor_layouts(evaluation, task) if sight.numbers else []
        )
    return {name: figure for name, figure in figures.items() if figure} | dict(
        evaluation.figures
    )


def statistics(rewards: Sequence[float]) -> dict[str, Any]:
    """Summarise rewards: their mean, standard deviation, and the rewards."""
    return {
        "mean": float(np.mean(rewards)),
        "std": float(np.std(rewards)),
        "rewards": list(rewards),
    }


def poor_layouts(evaluation: Evaluation, task: Task) -> list[dict[str, Any]]:
    """List the layouts in which a plan failed, the worst first, each with the numbers that were drawn for it."""
    if evaluation.status == "rejected" or len(task.parts) > 1:
        return []
    poor = [
        t
        for t in evaluation.trials
        if t.change is None and t.reward < task.success_reward
    ]
    listed: list[dict[str, Any]] = []
    for trial in sorted(poor, key=lambda trial: trial.reward)[:_LAYOUTS]:
        draw = task.draw(trial.layout)
        drawn = {name: round(draw(name, math.nan), 3) for name in draw.ranges}
        listed.append(
            {
                "layout": trial.layout,
                "engine": trial.engine,
                "reward": round(trial.reward, 3),
                **drawn,
            }
        )
    return listed


def elite_feedback(
    trial: Trial, seen: Observation, sight: Sight = ALL, several: bool = False
) -> dict[str, Any]:
    """Describe what was observed of an elite's trial, as JSON."""
    robots = [
        contact
        for contact in seen.contacts
        if contact.kind == "tool" and contact.other in seen.errors
    ]
    contacts = [
        *robots,
        *(contact for contact in seen.contacts if contact not in robots),
    ]
    described: dict[str, Any] = {
        "trial": _where(trial, several),
        "result": sight.text(_result(seen)),
        "goals": {
            name: f"{math.floor(100 * share)} %" for name, share in trial.goals
        },  # 100 % is whole
        "margins": [sight.text(str(margin)) for margin in trial.margins[:_BODIES]],
        "moved": _moves(seen, sight),
        "arrivals_s": list(seen.arrivals),
        "guards": list(seen.felt),
        "contacts": [_touch(contact, sight) for contact in contacts[:_CONTACTS]],
        "missed": _miss(seen),
        "lag": _lag(seen),
    }
    if sight.numbers:
        wrong = [
            (name, list(offset))
            for name, offset in seen.errors.items()
            if any(p is not None for p in offset)
        ]
        nearest = sorted(seen.clearances.items(), key=lambda item: item[1])
        described["error_m"] = dict(
            sorted(wrong, key=lambda item: item[0] not in seen.left)[:_BODIES]
        )
        described["path_m"] = {
            name: " ".join(_point(point) for point in path)
            for name, path in seen.paths.items()
        }
        described["times_s"] = list(seen.instants) if seen.paths else []
        described["clearance_m"] = dict(nearest[:_BODIES])
    return {key: value for key, value in described.items() if value}


def describe(evaluation: Evaluation, sight: Sight = ALL) -> str:
    """Say in one line what became of a candidate."""
    reason = sight.text(clean(evaluation.reason, _REASON))
    if evaluation.status != "ok":
        return f"{evaluation.status}: {reason}"
    words = [f"{evaluation.reward:.3f}"]
    if reason:
        words.append(f"invalid: {reason}")
    trial = evaluation.shown
    seen = evaluation.observation
    several = len(evaluation.tasks) > 1
    if trial is None or seen is None:
        moved_m = {} if trial is None else trial.moved_m
        ways = {name: way for name, way in moved_m.items() if way > _MOVED_M}
        farthest = sorted(ways, key=lambda name: -ways[name])[:_IN_A_LINE]
        return "; ".join(
            [
                " ".join(words),
                *(sight.text(f"{name} moved {ways[name]:.3f} m") for name in farthest),
            ]
        )

    found = elite_feedback(trial, seen, sight, several)
    if evaluation.combined:
        least = "".join(
            f", least margin: {margin}" for margin in found.get("margins", ())[:1]
        )
        words.append(
            f"({'; '.join(trial_lines(evaluation, sight))}); in {found['trial']}{least}:"
        )
    if not reason:
        words.append(found["result"])
    goals = ", ".join(
        f"{name} {share}" for name, share in found.get("goals", {}).items()
    )
    moved = [f"{name} {way}" for name, way in found.get("moved", {}).items()]
    touches = {
        contact.other: _touch(contact, sight)
        for contact in seen.contacts[::-1]
        if contact.kind != "body"
    }
    parts = [
        " ".join(words),
        goals and f"of the goals {goals}",
        *(moved[:_IN_A_LINE] or ["nothing moved"]),
        *([*touches.values()][: -_IN_A_LINE - 1 : -1] or [_nearest(seen, sight)]),
        _miss(seen),
        _lag(seen),
    ]
    return "; ".join(filter(None, parts))


def trial_lines(evaluation: Evaluation, sight: Sight = ALL) -> list[str]:
    """Say what became of each trial: those that are alike in one line, the worst first."""
    several = len(evaluation.tasks) > 1
    groups: dict[tuple[float, str], list[Trial]] = {}
    for trial in evaluation.trials:
        what = (
            trial.outcome
            if trial.status == "ok" and not trial.reason
            else f"{trial.status}: {trial.reason}"
        )
        groups.setdefault(
            (round(trial.reward, 3), sight.text(clean(what, _OUTCOME))), []
        ).append(trial)
    lines = []
    for (reward, what), trials in sorted(groups.items(), key=lambda item: item[0][0]):
        alike = len(trials) == len(evaluation.trials)
        where = (
            f"all {len(trials)} trials"
            if alike
            else ", ".join(_where(trial, several) for trial in trials)
        )
        lines.append(" ".join(filter(None, (f"{reward:.3f}", what, "in", where))))
    more = [f"{len(lines) - _OUTCOMES} others"] if len(lines) > _OUTCOMES else []
    return lines[:_OUTCOMES] + more


def _where(trial: Trial, several: bool) -> str:
    """Name a trial: the task of several, the engine, the layout's number, and that of a perturbation."""
    change = "" if trial.change is None else f"change {trial.change}"
    task = trial.task if several else ""
    return " ".join(
        filter(None, (task, trial.engine, f"layout {trial.layout}", change))
    )


def _result(seen: Observation) -> str:
    """Say what became of the goal's bodies, to which of them and when, and how many of several are in place."""
    said: str = seen.result
    if seen.what:
        said += {"stuck": " at ", "forbidden": ": "}.get(seen.result, " ") + seen.what
    if seen.at_s is not None and seen.result != "unreachable":
        said += f" from {_when(seen, seen.at_s)}"
    count = len(seen.errors)
    return (
        f"{said}, {count - len(seen.left)} of {count} in place"
        if 0 < len(seen.left) < count
        else said
    )


def _moves(seen: Observation, sight: Sight) -> dict[str, str]:
    """Describe how bodies moved: of several those of the goal that are not in place, then those that moved most."""
    stirred = {
        name: m
        for name, m in seen.moved.items()
        if math.hypot(*m.by) > _MOVED_M or m.tilt_deg >= 1
    }
    order = sorted(
        stirred,
        key=lambda name: (name not in seen.left, -math.hypot(*stirred[name].by)),
    )
    described = {}
    for name in order[:_BODIES]:
        tilt_deg = stirred[name].tilt_deg
        described[name] = sight.way(stirred[name]) + (
            f", tilted {tilt_deg:.0f} deg" if tilt_deg >= 1 else ""
        )
    if len(order) > _BODIES:
        described[f"{len(order) - _BODIES} others"] = "moved too"
    return described


def _touch(contact: Contact, sight: Sight) -> str:
    """Say what touched what, from when to when, how deep and how hard."""
    said = f"{contact.one} touched {contact.other} at {contact.first_s:.2f}-{contact.last_s:.2f} s"
    if not sight.numbers:
        return said
    if contact.depth_m >= _DEEP_M:
        said += f", {1000 * contact.depth_m:.1f} mm deep"
    return said if contact.force_n is None else f"{said}, {contact.force_n:.1f} N"


def _nearest(seen: Observation, sight: Sight) -> str:
    """Say of a robot that touched nothing how near it came to a body of the goal."""
    gaps = {
        name: seen.clearances[name] for name in seen.errors if name in seen.clearances
    }
    if not gaps or not sight.numbers:
        return "no contact"
    nearest = min(gaps, key=lambda name: gaps[name])
    return f"no contact, nearest to {nearest} {1000 * gaps[nearest]:.0f} mm"


def _miss(seen: Observation) -> str:
    number, metres, radians = seen.miss
    if metres < _MISS_M and radians < _MISS_RAD:
        return ""
    return (
        f"way to waypoint {number} missed by {1000 * metres:.0f} mm, {radians:.2f} rad"
    )


def _lag(seen: Observation) -> str:
    return (
        ""
        if seen.lag_rad < _LAG_RAD
        else f"lag {seen.lag_rad:.2f} rad at {_when(seen, seen.lag_s)}"
    )


def _when(seen: Observation, instant: float) -> str:
    """An instant, with the number of the waypoint that the arm is on its way to."""
    number = 1 + sum(arrival < instant for arrival in seen.arrivals)
    return f"{instant:.2f} s (" + (
        f"to waypoint {number})" if number <= len(seen.arrivals) else "after the last)"
    )


def _ids(group: Sequence[Evaluation]) -> str:
    ids = [evaluation.candidate.id for evaluation in group]
    return ", ".join(ids[:3]) + (f" and {len(ids) - 3} more" if len(ids) > 3 else "")


def _point(point: Sequence[float]) -> str:
    return f"({short_numbers(point, 3, ', ')})"

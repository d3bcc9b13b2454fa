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

from core.design import Evaluation, Trial, best_first
from core.designs.sight import Sight
from core.interfaces import Brief, Contact, Observation, Task
from core.support.text import by_reason, clean, short_numbers

_MISS_M, _MISS_RAD, _LAG_RAD, _MOVED_M, _DEEP_M = 0.001, 0.01, 0.01, 0.001, 0.001  # what is less is not worth its words
_BODIES, _CONTACTS, _LAYOUTS = 2, 6, 3
_REASON, _NAME, _OUTCOME = 300, 120, 100  # characters
_REASONS = 3  # of candidates without a line of their own
_OUTCOMES = 6  # kinds of trials
_DRAWN = 8  # numbers of a layout


def last_generation(tried: Iterable[Evaluation]) -> tuple[Evaluation, ...]:
    """Return the evaluations of the last generation among those that were tried, in the order of `Candidate.key`."""
    tried = list(tried)
    last = max((e.candidate.generation for e in tried), default=0)
    return tuple(sorted((e for e in tried if e.candidate.generation == last), key=lambda e: e.candidate.key))


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


def most_telling(elites: Sequence[Evaluation], evaluations: Iterable[Evaluation]) -> Iterator[Evaluation]:
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
        named = {"tool_name": clean(tool.name, _NAME)} if tool is not None and tool.name else {}
        entries.append({"id": name, "reward": round(known[name].reward, 4), **named, "critique": text})
    return json.dumps(entries, indent=1, ensure_ascii=False) if entries else ""


def _failures(evaluations: Iterable[Evaluation]) -> list[Evaluation]:
    """The best candidate of each class of failure, the most frequent class first."""
    groups: dict[str, list[Evaluation]] = {}
    for evaluation in best_first(evaluations):
        if (what := outcome_of(evaluation)) not in ("solved", "placed"):
            groups.setdefault(what, []).append(evaluation)
    ordered = sorted(groups.values(), key=lambda group: (len(group), group[0].reward), reverse=True)
    return [group[0] for group in ordered]


@lru_cache(maxsize=2)
def generation_lines(evaluations: tuple[Evaluation, ...], budget: int, sight: Sight | None = None) -> str:
    """Write a line for each candidate, in about ``budget`` characters.

    Candidates with equal lines share one. Where they would be too long, each kind keeps as many of its best as the
    others, and the last line counts what is left out. With ``sight`` no number of a body is in them.
    """
    groups: dict[str, list[Evaluation]] = {}
    others = sorted((e for e in evaluations if e.status != "ok"), key=lambda e: (e.status, e.candidate.key))
    for evaluation in (*best_first(evaluations, tie=0.0), *others):
        groups.setdefault(describe(evaluation, sight), []).append(evaluation)
    lines = {text: f"- {_ids(group)}: {text}" for text, group in groups.items()}
    queues: dict[str, list[str]] = {}
    for text, group in groups.items():
        queues.setdefault(outcome_of(group[0]), []).append(text)
    chosen: set[str] = set()
    left = budget
    for text in (queue[rank] for rank in range(len(groups)) for queue in queues.values() if rank < len(queue)):
        left -= len(lines[text]) + 1
        if left < 0 and chosen:
            break
        chosen.add(text)
    shown = [line for text, line in lines.items() if text in chosen]
    rest = [evaluation for text, group in groups.items() if text not in chosen for evaluation in group]
    why = by_reason((e.candidate.id, e.reason) for e in rest)[:_REASONS]
    counts = ", ".join(f"{count} {name}" for name, count in Counter(map(outcome_of, rest)).most_common())
    left_out = "; ".join([f"{len(rest)} candidates: {counts}", *(_said(clean(line, _OUTCOME), sight) for line in why)])
    return "\n".join([*shown, *([f"- Left out: {left_out}."] if rest else [])])


def combined_figures(evaluation: Evaluation, task: Task, sight: Sight | None = None) -> dict[str, Any]:
    """Describe what a fitness made of several trials, as JSON: the same for the same trials, however long they took."""
    figures: dict[str, Any] = {}
    if evaluation.combined:
        figures["trials"] = trial_lines(evaluation, sight)
        figures["engines"] = {engine: statistics(rewards) for engine, rewards in evaluation.by_engine.items()}
        if poor := poor_layouts(evaluation, task, drawn=sight is None):
            figures["poor_layouts"] = poor
    return figures | dict(evaluation.figures)


def statistics(rewards: Sequence[float]) -> dict[str, Any]:
    """Summarise rewards: their mean, standard deviation, and the rewards."""
    return {"mean": float(np.mean(rewards)), "std": float(np.std(rewards)), "rewards": list(rewards)}


def poor_layouts(evaluation: Evaluation, task: Task, *, drawn: bool = True) -> list[dict[str, Any]]:
    """List the layouts in which a plan failed, the worst first, each with the numbers farthest from the usual ones.

    Without ``drawn`` they have no numbers.
    """
    if not evaluation.combined or evaluation.status == "rejected" or len(task.parts) > 1:
        return []
    engines = len(evaluation.by_engine)
    poor = [t for t in evaluation.trials if t.change is None and t.reward < task.success_reward]
    shown: list[dict[str, Any]] = []
    for trial in sorted(poor, key=lambda trial: trial.reward)[:_LAYOUTS]:
        draw = task.draw(trial.layout)
        known = {name: draw(name, math.nan) for name in draw.ranges} if drawn else {}
        far = sorted(known, key=lambda name: -abs(known[name] - np.mean(draw.ranges[name])) / np.ptp(draw.ranges[name]))
        shown.append(
            {  # JSON
                "layout": trial.layout,
                **({"engine": trial.engine} if engines > 1 else {}),
                "reward": round(trial.reward, 3),
                **{name: round(known[name], 3) for name in known if name in far[:_DRAWN]},
            }
        )
    return shown


def elite_feedback(trial: Trial, seen: Observation, sight: Sight | None = None) -> dict[str, Any]:
    """Describe what was observed of an elite's trial; with ``sight`` without the numbers of bodies."""
    described: dict[str, Any] = {"trial": _where(trial), "result": _said(_result(seen), sight)}
    described["goals"] = {name: _percent(share) for name, share in trial.goals}
    described["margins"] = [_said(str(margin), sight) for margin in trial.margins[:_BODIES]]
    described["moved"] = dict(_moves(seen, 2 * _BODIES, sight))
    wrong = {name: offset for name, offset in seen.errors.items() if any(part is not None for part in offset)}
    worst = sorted(wrong, key=lambda name: -max(abs(part) for part in wrong[name] if part is not None))
    described["error_m"] = {name: list(wrong[name]) for name in worst[: 2 * _BODIES]} if sight is None else {}
    described |= {"arrivals_s": list(seen.arrivals), "guards": list(seen.felt)}
    if seen.paths and sight is None:
        described["times_s"] = list(seen.instants)
        described["path_m"] = {name: " ".join(_point(point) for point in path) for name, path in seen.paths.items()}
    robot = [contact for contact in seen.contacts if contact.kind != "body"]
    others = [contact for contact in robot if contact.kind == "arm" or contact.other not in seen.errors]
    wanted = [contact for contact in seen.contacts if contact not in others]
    described |= {"contacts": _contacts(wanted, sight), "other_contacts": _contacts(others, sight)}
    near = [] if sight else sorted(seen.clearances.items(), key=lambda item: item[1])[:_BODIES]
    described |= {"clearance_m": dict(near), "missed": _miss(seen), "lag": _lag(seen)}
    return {key: value for key, value in described.items() if value}


def describe(evaluation: Evaluation, sight: Sight | None = None) -> str:
    """Say in one line what became of a candidate; with ``sight`` without the numbers of bodies."""
    if evaluation.status != "ok":
        return f"{evaluation.status}: {_said(clean(evaluation.reason, _REASON), sight)}"
    seen = evaluation.observation
    parts = [f"{evaluation.reward:.3f}"]
    if evaluation.reason:
        parts[0] += f" invalid: {_said(clean(evaluation.reason, _REASON), sight)}"
    if seen is None:
        moved = sorted(evaluation.moved_m.items(), key=lambda item: -item[1])[:_BODIES]
        ways = {name: "" if sight else f" {way:.3f} m" for name, way in moved if way > _MOVED_M}
        return "; ".join([*parts, *(f"{name} moved{way}" for name, way in ways.items())])
    if evaluation.combined and evaluation.shown is not None:
        shown = f"{_where(evaluation.shown)}{_said(_margin(evaluation.shown), sight)}"
        parts[0] += f" ({'; '.join(trial_lines(evaluation, sight))}); in {shown}:"
    if not evaluation.reason:
        parts[0] += f" {_said(_result(seen), sight)}"
    goals = evaluation.shown.goals if evaluation.shown is not None else ()
    parts += [f"of the goals {', '.join(f'{name} {_percent(share)}' for name, share in goals)}"] if goals else []
    moves = _moves(seen, _BODIES, sight)
    parts += [f"{name} {move}" for name, move in moves] or ["nothing moved"]
    first: dict[str, Contact] = {}
    for contact in seen.contacts:
        if contact.kind != "body":
            first.setdefault(contact.other, contact)
    touched = [f"{c.one} touched {c.other} at {_span(c)}" for c in list(first.values())[:_BODIES]]
    parts += touched or ["no contact"]
    missed = {name: seen.clearances[name] for name in seen.errors if name in seen.clearances}
    if missed and sight is None and seen.result in ("never touched", "unreachable", "stuck"):
        nearest = min(missed, key=lambda name: missed[name])
        parts.append(f"nearest to {nearest} {1000 * missed[nearest]:.0f} mm")
    return "; ".join(filter(None, (*parts, _miss(seen), _lag(seen))))


def trial_lines(evaluation: Evaluation, sight: Sight | None = None) -> list[str]:
    """Say what became of each trial: those that are alike in one line, the worst first."""
    groups: dict[tuple[float, str], list[Trial]] = {}
    for trial in evaluation.trials:
        what = trial.outcome if trial.status == "ok" and not trial.reason else f"{trial.status}: {trial.reason}"
        groups.setdefault((round(trial.reward, 3), _said(clean(what, _OUTCOME), sight)), []).append(trial)
    lines = [
        f"{reward:.3f} {what}".strip() + f" in {_wheres(trials, evaluation.trials)}"
        for (reward, what), trials in sorted(groups.items(), key=lambda item: item[0][0])
    ]
    return lines[:_OUTCOMES] + ([f"{len(lines) - _OUTCOMES} others"] if len(lines) > _OUTCOMES else [])


def _wheres(trials: Sequence[Trial], among: Sequence[Trial]) -> str:
    """Name the trials of a group; where there are several engines or perturbations by these as well."""
    if len(trials) == len(among):
        return f"all {len(trials)} trials"
    many, changed = len({trial.engine for trial in among}) > 1, any(trial.change is not None for trial in among)
    names = [
        " ".join(filter(None, (f"{t.layout}{f'/{t.change}' if changed else ''}", t.engine if many else "", t.task)))
        for t in trials
    ]
    return f"layout{'s' * (len(names) > 1)} {', '.join(names)}"


def _margin(trial: Trial) -> str:
    return f", least margin: {trial.margins[0]}" if trial.margins else ""


def _where(trial: Trial) -> str:
    """Name a trial: the task of several, the engine, the layout's number, and that of a perturbation."""
    change = "" if trial.change is None else f", change {trial.change}"
    return f"{trial.task and f'task {trial.task}, '}engine {trial.engine}, layout {trial.layout}{change}"


def _result(seen: Observation) -> str:
    """Say what became of the goal's bodies, to which of them and when, and how many of several are in place."""
    what = f"at {seen.what}" if seen.result == "stuck" else seen.what
    when = "" if seen.at_s is None or seen.result == "unreachable" else f"from {_when(seen, seen.at_s)}"
    said, count = " ".join(filter(None, (seen.result, what, when))), len(seen.errors)
    if seen.result in ("solved", "forbidden"):
        return said.replace("forbidden", "forbidden:", 1)
    return f"{said}, {count - len(seen.left)} of {count} in place" if 0 < len(seen.left) < count else said


def _moves(seen: Observation, most: int, sight: Sight | None) -> list[tuple[str, str]]:
    """Describe how bodies moved: of several those of the goal that are not in place, then those that moved most."""
    stirred = {
        name: moved for name, moved in seen.moved.items() if math.hypot(*moved.by) > _MOVED_M or moved.tilt_deg >= 1
    }
    described = []
    for name in sorted(stirred, key=lambda name: (name not in seen.left, -math.hypot(*stirred[name].by)))[:most]:
        moved = stirred[name]
        tilt = f", tilted {moved.tilt_deg:.0f} deg" if moved.tilt_deg >= 1 else ""
        way = sight.way(moved) if sight else f"by {_point(moved.by)} to {_point(moved.to)}"
        described.append((name, f"{way}{tilt}"))
    if len(stirred) > most:
        described.append((f"{len(stirred) - most} others", "moved too"))
    return described


def _contacts(contacts: Sequence[Contact], sight: Sight | None) -> list[str]:
    described = [f"{c.one} with {c.other} {_span(c)}{_deep(c) if sight is None else ''}" for c in contacts[:_CONTACTS]]
    return described + ([f"{len(contacts) - _CONTACTS} more"] if len(contacts) > _CONTACTS else [])


def _said(text: str, sight: Sight | None) -> str:
    return text if sight is None else sight.text(text)


def _percent(share: float) -> str:
    return f"{math.floor(100 * share)} %"  # 100 % is whole


def _deep(contact: Contact) -> str:
    force = "" if contact.force_n is None else f", {contact.force_n:.1f} N"
    return (f", {1000 * contact.depth_m:.1f} mm deep" if contact.depth_m >= _DEEP_M else "") + force


def _span(contact: Contact) -> str:
    return f"{contact.first_s:.2f}-{contact.last_s:.2f} s"


def _miss(seen: Observation) -> str:
    number, metres, radians = seen.miss
    if metres < _MISS_M and radians < _MISS_RAD:
        return ""
    return f"way to waypoint {number} missed by {1000 * metres:.0f} mm, {radians:.2f} rad"


def _lag(seen: Observation) -> str:
    return "" if seen.lag_rad < _LAG_RAD else f"lag {seen.lag_rad:.2f} rad at {_when(seen, seen.lag_s)}"


def _when(seen: Observation, instant: float) -> str:
    """An instant, with the number of the waypoint that the arm is on its way to."""
    number = 1 + sum(arrival < instant for arrival in seen.arrivals)
    return f"{instant:.2f} s (" + (f"to waypoint {number})" if number <= len(seen.arrivals) else "after the last)")


def _ids(group: Sequence[Evaluation]) -> str:
    ids = [evaluation.candidate.id for evaluation in group]
    return ", ".join(ids[:3]) + (f" and {len(ids) - 3} more" if len(ids) > 3 else "")


def _point(point: Sequence[float]) -> str:
    return f"({short_numbers(point, 3, ', ')})"

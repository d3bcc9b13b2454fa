"""Write what was observed of rollouts: a line for each candidate of a generation, more for elites."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from operator import itemgetter
from typing import Any

from core.design import Tool
from core.designs.prompt_values import RunFacts
from core.interfaces import Brief, Contact, Evaluation, Observation, Task, Trial
from core.support.text import by_reason, clean, number, short_numbers
from core.trial import best_first, summarise_rewards
from core.values.observations import Sight
from plugins.vlms.context.causes import cause_lines, name_further
from plugins.vlms.context.phrases import phrase
from plugins.vlms.telling import REACHED, last_generation, outcome_of

WHOLE = 2
"""So many elites have their plans and what was observed; the others have a line in the last round."""

ALL = Sight()
"""All may be said of bodies."""

# What moved or tilted less is not worth its words.
_MOVED_M = 0.001
_TILT_DEG = 1.0

# The most that is written of an elite.
_CONTACTS = 8
_BODIES = 4
_GOAL_BODIES = 12
_NEAR_M = 0.1  # what the robot stayed farther from is not worth its words
_AMPLE = 0.9  # limits with more room than this say nothing of a miss
_LAYOUTS = 3
_OUTCOMES = 6

# The most that is written in a candidate's line.
_TOUCHES = 2
_REASON = 300  # characters
_NAME = 50  # characters
_OUTCOME = 100  # characters

_REASONS = 3  # of candidates without a line of their own
_FREE = (None, None, None)  # the error of a body whose place does not matter


def candidates_value(
    brief: Brief,
    mounted: Tool,
    facts: RunFacts,
) -> str:
    """Write the lines about the last generation for templates, their ``candidates``; elites shown whole have none.

    The paper shows no lines at all.

    Args:
        brief: which has what was tried.
        mounted: the tool on the arm, which no line says anything of.
        facts: of the run: the settings of prompts, and the level at which bodies are described.
    """
    settings = facts.settings
    if settings.feedback == "paper":
        return ""

    sight = facts.level.sight(brief.task, brief.scene_seed)
    above = {elite.candidate.id for elite in brief.elites[:WHOLE]}
    last = [e for e in last_generation(brief.tried) if e.candidate.varied is None]
    others = tuple(e for e in last if e.candidate.id not in above)

    return generation_lines(others, settings.generation_characters, sight)


@lru_cache(maxsize=2)
def generation_lines(
    evaluations: tuple[Evaluation, ...],
    budget: int,
    sight: Sight = ALL,
) -> str:
    """Write a line for each candidate, the best first.

    Candidates with equal lines share one. Where they would be too long, each kind of outcome keeps as many of its best
    as the others, and the last line counts what is left out.

    Args:
        evaluations: those of a generation; all agents are shown the same, so that it is kept.
        budget: about how many characters there may be.
        sight: what may be said of bodies.
    """
    others = [e for e in evaluations if e.status != "ok"]
    others.sort(key=lambda e: (e.status, e.candidate.key))

    groups: dict[str, list[Evaluation]] = {}
    for evaluation in (*best_first(evaluations, tie=0.0), *others):
        text = describe(evaluation, sight)
        groups.setdefault(text, []).append(evaluation)

    lines: dict[str, str] = {}

    left_out: list[Evaluation] = []
    for text in _alternate(groups):
        names = [name_design(evaluation) for evaluation in groups[text]]
        line = f"- {phrase('observed', 'ids', names)}: {text}"
        budget -= len(line) + 1

        if budget < 0 and lines:  # the best one has its line in any case
            left_out += groups[text]
        else:
            lines[text] = line

    shown = [lines[text] for text in groups if text in lines]
    if left_out:
        shown.append(_count_left_out(left_out, sight))

    return "\n".join(shown)


def name_design(evaluation: Evaluation) -> str:
    """Write the id of a candidate, and the name of its design if that has one."""
    candidate = evaluation.candidate
    name = clean(candidate.design_name, _NAME)
    return f'{candidate.id} "{name}"' if name else candidate.id


def _alternate(groups: dict[str, list[Evaluation]]) -> list[str]:
    """Order the texts of groups: first the best one of each kind of outcome, then the second of each...

    Args:
        groups: evaluations that share a line, by its text.
    """
    counts = Counter[str]()

    ranks: dict[str, int] = {}
    for text, group in groups.items():
        kind = _kind_of(group[0])
        ranks[text] = counts[kind]
        counts[kind] += 1

    return sorted(groups, key=lambda text: ranks[text])


def _kind_of(evaluation: Evaluation) -> str:
    """Name the kind of a candidate's outcome; what is solved but fails in a further layout is one of its own."""
    outcome = outcome_of(evaluation)
    counted = evaluation.finals.count_held()
    if outcome in REACHED and counted.held < counted.layouts:
        return f"{outcome} but not in all further layouts"

    return outcome


def _count_left_out(evaluations: Sequence[Evaluation], sight: Sight) -> str:
    """Write the line about candidates that have none: their outcomes, and the commonest reasons.

    Args:
        evaluations: without a line of their own.
        sight: what may be said of bodies.
    """
    counts = Counter(map(_kind_of, evaluations)).most_common()
    reasons = by_reason((e.candidate.id, e.reason) for e in evaluations)
    shown = [sight.text(clean(str(reason), _OUTCOME)) for reason in reasons[:_REASONS]]

    return phrase("observed", "left_out", len(evaluations), counts, shown)


def report(evaluation: Evaluation, task: Task) -> dict[str, Any]:
    """Describe what was observed of a candidate, see `core.task.Level.report`.

    Args:
        evaluation: of one candidate.
        task: in which it was tried.
    """
    found: dict[str, Any] = {}
    if evaluation.observation is not None:
        found["observed"] = describe(evaluation, rewarded=False)

    details = combined_figures(evaluation, task)
    if details:
        found["details"] = details

    return found


def combined_figures(
    evaluation: Evaluation,
    task: Task,
    sight: Sight = ALL,
) -> dict[str, Any]:
    """Describe what a fitness made of several trials, as JSON: the same for the same trials, however long they took.

    Args:
        evaluation: of the trials.
        task: what they were tried in.
        sight: what may be said of bodies.

    Returns:
        Of several trials a line for each kind of end, the rewards by engine if there are several, and the layouts that
        failed; and the figures of the fitness.
    """
    figures: dict[str, Any] = {}
    if evaluation.combined:
        figures["trials"] = trial_lines(evaluation, sight)
        if len(evaluation.by_engine) > 1:
            figures["engines"] = {
                engine: summarise_rewards(rewards)
                for engine, rewards in evaluation.by_engine.items()
            }

        poor = _poor_layouts(evaluation, task)

        if poor and sight.numbers:
            figures["poor_layouts"] = poor

    return figures | dict(evaluation.figures)


def _poor_layouts(evaluation: Evaluation, task: Task) -> list[dict[str, Any]]:
    """List the layouts in which a plan failed, the worst first, each with the numbers that were drawn for it.

    Args:
        evaluation: of several trials.
        task: which has the numbers of a layout.

    Returns:
        As JSON; perturbed scenes don't count as layouts.
    """
    if evaluation.status == "rejected" or len(task.parts) > 1:
        return []

    poor: list[dict[str, Any]] = []
    tried = (*evaluation.trials, *evaluation.finals.in_order())
    for trial in sorted(tried, key=lambda trial: trial.reward):
        if trial.where.change is not None or trial.solved:
            continue

        described = {
            "layout": trial.layout,
            "engine": trial.engine,
            "reward": float(number(trial.reward, 3)),
        }
        outcome = clean(trial.reason or trial.outcome, _OUTCOME)
        if outcome:
            described["outcome"] = outcome

        draw = task.draw(trial.layout)

        for name in draw.ranges:
            described[name] = round(draw(name, math.nan), 3)

        poor.append(described)

    return poor[:_LAYOUTS]


def describe(
    evaluation: Evaluation, sight: Sight = ALL, *, rewarded: bool = True
) -> str:
    """Say in one line what became of a candidate.

    It is why it was not played to its end; or else its reward, and what was observed of the trial that stands for all.

    Args:
        evaluation: of one candidate.
        sight: what may be said of bodies.
        rewarded: say the reward, too.
    """
    reason = sight.text(clean(evaluation.reason, _REASON))
    if evaluation.status != "ok":
        return f"{evaluation.status}: {reason}"

    seen = evaluation.observation
    head = number(evaluation.reward, 3) if rewarded else ""
    if seen is None:
        return f"{head} invalid: {reason}".strip() if reason else head

    first: dict[str, Contact] = {}  # of the robot, by body
    for contact in seen.contacts:
        if contact.kind != "body":
            first.setdefault(contact.other, contact)

    entry = elite_feedback(evaluation, sight)
    trials = trial_lines(evaluation, sight) if evaluation.combined else []
    outcome = (head, reason, trials)
    touches = sorted(first.values(), key=lambda touch: touch.other not in seen.what)

    shown = (seen, entry, touches[:_TOUCHES], sight.numbers)
    return phrase("observed", "line", *outcome, *shown).strip()


def trial_lines(evaluation: Evaluation, sight: Sight = ALL) -> list[str]:
    """Say what became of each trial: those that are alike in one line, the worst first.

    Args:
        evaluation: of several trials.
        sight: what may be said of bodies.
    """
    places: dict[str, list[str]] = {}
    for trial in sorted(evaluation.trials, key=lambda trial: trial.reward):
        outcome = trial.outcome
        if trial.status != "ok" or trial.reason:
            status = "invalid" if trial.status == "ok" else trial.status
            outcome = f"{status}: {trial.reason}"

        outcome = sight.text(clean(outcome, _OUTCOME))
        text = f"{number(trial.reward, 3)} {outcome}".rstrip()
        name = phrase("observed", "trial", trial, len(evaluation.tasks))
        places.setdefault(text, []).append(name)

    if len(places) == 1:
        (text,) = places
        everywhere = f"{text} in all {len(evaluation.trials)} trials"
        return [everywhere, *_finals_lines(evaluation, sight)]

    lines = [f"{text} in {', '.join(names)}" for text, names in places.items()]
    if len(lines) > _OUTCOMES:
        lines[_OUTCOMES:] = [f"{len(lines) - _OUTCOMES} others"]

    return [*lines, *_finals_lines(evaluation, sight)]


def _finals_lines(evaluation: Evaluation, sight: Sight) -> list[str]:
    """Say in how many further layouts a candidate holds, if it was tried in any, and why it fails in the others."""
    counted = evaluation.finals.count_held()
    if not counted.layouts:
        return []

    further = "further layouts"
    if name_further(evaluation.finals.in_order()) == "change":
        further = "small changes of the scene"
    held = f"holds in {counted.held} of {counted.layouts} {further}"
    return [held, *cause_lines(evaluation, sight)]


def elite_feedback(elite: Evaluation, sight: Sight = ALL) -> dict[str, Any]:
    """Describe what was observed of the trial that stands for an elite, as JSON; empty: nothing was.

    Lengths are metres, times seconds from the start of the motion. What is empty, or not worth its words, is left out.

    Args:
        elite: the evaluation of a candidate.
        sight: what may be said of bodies.
    """
    trial = elite.shown
    seen = elite.observation
    if trial is None or seen is None:
        return {}

    described: dict[str, Any] = {
        "trial": phrase("observed", "trial", trial, len(elite.tasks))
        if elite.combined
        else "",
        "result": sight.text(phrase("observed", "result", seen, trial.reward)),
        # Rounded down, since 100 % means all of it.
        "goals": {name: f"{int(100 * share)} %" for name, share in trial.goals},
        "margins": _margins(trial, seen, sight),
        "measured": seen.measured if sight.numbers else (),
        "crux": _describe_crux(seen, sight),
        "moved": _moves(seen, sight),
        "arrivals_s": list(seen.arrivals),
        "guards": list(seen.felt),
        "looks": [sight.text(text) for text in seen.looked],
        "grips": [sight.text(text) for text in seen.gripped],
        "contacts": _touches(seen, sight),
        "missed": phrase("observed", "miss", seen),
        "lag": phrase("observed", "lag", seen),
    }

    if sight.numbers:
        described |= _places(seen)

    return {key: value for key, value in described.items() if value}


def _describe_crux(seen: Observation, sight: Sight) -> str:
    """Say how the body went that the rollout turned on; empty: there is none."""
    if seen.crux is None:
        return ""
    return sight.text(phrase("observed", "crux", seen.crux, sight.numbers))


def _margins(trial: Trial, seen: Observation, sight: Sight) -> list[str]:
    """Say how much room was left to each limit, the least first, and which part came nearest to what is kept clear of.

    Args:
        trial: that stands for all.
        seen: what was observed of it.
        sight: what may be said of bodies.
    """
    lines = []
    for margin in trial.margins[:_BODIES]:
        if not margin.unit:  # the reward itself has none, and is said already
            continue
        if trial.solved or margin.margin < _AMPLE:  # else it says nothing of the miss
            nearest = seen.nearest.get(margin.body)
            lines.append(phrase("observed", "margin", margin, nearest, sight.numbers))

    return lines


def _touches(seen: Observation, sight: Sight) -> list[str]:
    """Say what touched what, from first to last.

    Where there is more to say than there is room for, what the result is about goes first, then the first touch of each
    body, by the tool before others.

    Args:
        seen: what was observed of a trial.
        sight: what may be said of bodies.
    """
    first = {contact.other: contact for contact in reversed(seen.contacts)}
    chosen = sorted(
        seen.contacts,
        key=lambda contact: (
            contact.other not in seen.what,
            contact is not first[contact.other],
            contact.kind != "tool",
        ),
    )[:_CONTACTS]
    chosen.sort(key=lambda contact: contact.first_s)
    lines = [phrase("observed", "touch", contact, sight.numbers) for contact in chosen]
    left = [contact for contact in seen.contacts if contact not in chosen]
    if left:
        bodies = dict.fromkeys(contact.other for contact in left)
        lines.append(f"{len(left)} more, of {', '.join([*bodies][:_GOAL_BODIES])}")

    return lines


def _places(seen: Observation) -> dict[str, Any]:
    """Tell in numbers what the robot came near, and where bodies were and when: if it is solved, of its crux alone.

    Args:
        seen: what was observed of a trial.

    Returns:
        By the words of the prompt: metres, seconds, and paths as texts of points.
    """
    near = [item for item in seen.clearances.items() if item[1] < _NEAR_M]
    near.sort(key=itemgetter(1))
    clearances = {}
    for name, gap in near[:_BODIES]:
        part, at_s = seen.nearest.get(name, ("", 0.0))
        by = f" by {part} at {at_s:.2f} s" if part else ""
        clearances[name] = f"{gap:.4g}{by}"

    places: dict[str, Any] = {"clearance_m": clearances}

    told = seen.paths
    if seen.result == "solved":  # then it is room that is left to gain
        crux = "" if seen.crux is None else seen.crux.body
        told = {name: path for name, path in told.items() if name == crux}

    if told:
        paths = {}
        for name, path in told.items():
            points = [f"({short_numbers(point, 3, ', ')})" for point in path]
            paths[name] = " ".join(points)
        places["path_m"] = paths
        places["times_s"] = list(seen.instants)

    return places


def _moves(seen: Observation, sight: Sight) -> dict[str, str]:
    """Describe how bodies moved: the crux, those of the goal, not those in place first, then what moved most.

    Args:
        seen: what was observed of a trial.
        sight: what may be said of bodies.

    Returns:
        By the name of the body; the last entry may name others.
    """
    ways = {name: math.hypot(*moved.by) for name, moved in seen.moved.items()}
    stirred = [
        name
        for name, moved in seen.moved.items()
        if ways[name] > _MOVED_M or moved.tilt_deg >= _TILT_DEG
    ]

    def rank(name: str) -> tuple[bool, bool, bool, float]:
        crux = seen.crux is not None and seen.crux.body == name
        return (not crux, name not in seen.left, name not in seen.errors, -ways[name])

    stirred.sort(key=rank)
    wanted = sum(name in seen.errors for name in stirred)
    most = max(_BODIES, min(wanted, _GOAL_BODIES))

    described = {}
    for name in stirred[:most]:
        moved = seen.moved[name]
        off = seen.errors.get(name, _FREE) if seen.result != "solved" else _FREE
        # Where it ended follows from how far it is off.
        way = sight.way(moved, ends=off == _FREE)
        placed = name in seen.errors and name not in seen.left
        described[name] = phrase(
            "observed", "move", moved, way, off, placed, sight.numbers
        )

    others = stirred[most:]
    if others:
        described[", ".join(others[:_GOAL_BODIES])] = "moved too"

    return described

"""Make trials of what an engine played: look for what is unphysical, reward the end, and observe."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain

import numpy as np

from core.goals import goals_shares
from core.interfaces import Task
from core.plugins import describe_part
from core.plugins.blame import PluginError
from core.robot.kinematics import arm_of
from core.scene import State, Trace
from core.simulation.attempt import Attempt, Stage
from core.simulation.measuring import measure
from core.simulation.observing import observe
from core.solids.contacts import Contacts, find_contacts, make_trace
from core.solids.penetration import Explosion, findings
from core.solids.record_rate import is_finite
from core.support.text import number, shorten
from core.task import margins_of, reward_of
from core.trial import NOTHING, Trial
from core.values.margins import least_first

_WARNINGS = 10  # findings of a rollout that are listed


def judge_attempts(stage: Stage, attempts: Sequence[Attempt]) -> None:
    """Check what was played, and make a trial of each attempt.

    Args:
        stage: the condition in which they were tried.
        attempts: what was played, each with its outcome. They get their trials.
    """
    for attempt in attempts:
        failure = _find_failure(stage, attempt)
        if failure is not None:
            attempt.end(stage, "failed", failure)
        else:
            attempt.trial = _make_trial(stage, attempt)


def _find_failure(stage: Stage, attempt: Attempt) -> str | None:
    """Find what was unphysical and what touched, as far as the condition asks for it.

    Returns:
        Why the rollout failed; None: it did not.
    """
    if attempt.problem is not None:
        return attempt.problem

    outcome = attempt.outcome
    if outcome.error is not None or outcome.start is None or outcome.end is None:
        return outcome.error or "the simulator returned no state"

    recording = outcome.recording
    if recording is not None and stage.settings.penetration != "ignore":
        parts = attempt.scene, stage.task.robot, attempt.job.tool, recording
        try:
            attempt.findings = findings(*parts)
        except Explosion as explosion:
            return f"the simulation blew up: {explosion}"

    if stage.task.reads_trace and _look_for_contacts(stage, attempt) is None:
        return "the reward reads a trace, and the simulator returned no recording of finite states"

    return None


def _look_for_contacts(stage: Stage, attempt: Attempt) -> Contacts | None:
    """Find what touched, and keep it; None: there is no recording of finite states."""
    recording = attempt.outcome.recording
    if recording is not None and is_finite(recording):
        parts = attempt.scene, stage.task.robot, attempt.job.tool, recording
        attempt.contacts = find_contacts(*parts)

    return attempt.contacts


def _make_trial(stage: Stage, attempt: Attempt) -> Trial:
    """Make the trial of an attempt that came to its end in a condition."""
    task = stage.task
    motion = attempt.motion
    outcome = attempt.outcome
    scene = attempt.scene
    assert outcome.start is not None
    assert outcome.end is not None
    start = scene.complete(outcome.start)
    end = scene.complete(outcome.end)
    trace = None
    if task.reads_trace and attempt.contacts is not None:
        trace = make_trace(scene, attempt.contacts, outcome.gripped)

    world = (start, end, trace)
    reward = _compute_reward(task, *world)
    shifts = np.linalg.norm(end.positions - start.positions, axis=-1).tolist()

    held = chain.from_iterable(entry.margins for entry in outcome.gripped)
    texts = [finding.text for finding in attempt.findings]
    if len(texts) > _WARNINGS:
        texts[_WARNINGS:] = [f"{len(texts) - _WARNINGS} more such findings"]

    trial = Trial(
        stage.where,
        attempt.candidate.id,
        "ok",
        reward,
        solved=task.is_solved(reward, *world),
        moved_m=dict(zip(start.names, shifts, strict=True)),
        warnings=(
            *attempt.warnings,
            *motion.slowdowns(),
            *outcome.warnings,
            *(str(entry) for entry in outcome.gripped if entry.failed),
            *texts,
        ),
        margins=least_first((*margins_of(task, *world, reward), *held)),
        goals=goals_shares(task, *world),
        measured=measure(task, motion, outcome),
        torques=arm_of(task.robot).share_torques(outcome.torques),
    )
    if not 0.0 <= reward <= 1.0:
        reason = f"task {task.name}: the reward {reward} is not in [0, 1]"
        trial = replace(trial, status="failed", reward=0.0, solved=False, reason=reason)

    return _forbid_penetration(stage, _observe(stage, trial, attempt), attempt)


def _observe(stage: Stage, trial: Trial, attempt: Attempt) -> Trial:
    """Add what was observed of a rollout, if that is asked for or if the task pays nothing: that has a cause."""
    if trial.reward >= NOTHING and not stage.settings.observe:
        return trial

    if attempt.contacts is None and _look_for_contacts(stage, attempt) is None:
        return trial

    seen = observe(stage.task, attempt, trial)
    text = f"{seen.result} {seen.what}".strip()
    return replace(trial, touch_m=seen.touch_m, outcome=text, observation=seen)


def _forbid_penetration(stage: Stage, trial: Trial, attempt: Attempt) -> Trial:
    """Set the reward of a trial to 0 for penetration, where that is forbidden."""
    found = attempt.findings
    if stage.settings.penetration != "forbid" or trial.reward <= 0:
        return trial

    excused = _list_excused(stage, trial, attempt) if found else set()
    recording = attempt.outcome.recording
    if excused and recording is not None:
        parts = attempt.scene, stage.task.robot, attempt.job.tool, recording
        found = findings(*parts, excused)

    passages = [finding.text for finding in found if finding.penetration]
    if not passages:
        return trial

    counts = f"so that its reward of {number(trial.reward, 2)} does not count"
    reason = trial.reason or f"{passages[0]}, {counts}"
    return replace(trial, reward=0.0, solved=False, reason=reason)


def _list_excused(stage: Stage, trial: Trial, attempt: Attempt) -> set[str]:
    """List the bodies on joints that meet their goals by more than they are deep in others, as a lid on its box."""
    contacts = attempt.contacts or _look_for_contacts(stage, attempt)
    if contacts is None:
        return set()

    excused = set()
    for joint in attempt.scene.joints:
        lever = float(np.linalg.norm(np.cross(joint.axis, joint.origin)))
        metres = {"m": 1.0, "rad": lever, "deg": math.radians(lever)}
        rooms = [
            abs(margin.value - margin.limit) * metres[margin.unit]
            for margin in trial.margins
            if margin.subject == joint.body and margin.unit in metres
        ]
        depths = [
            depth
            for (kind, *pair), depth in contacts.depths.items()
            if kind == "body" and joint.body in pair
        ]
        if rooms and min(rooms) > max(depths, default=0.0):
            excused.add(joint.body)

    return excused


def _compute_reward(task: Task, start: State, end: State, trace: Trace | None) -> float:
    """Compute what a task pays for a world.

    Raises:
        PluginError: the task returned something else than an array of one number; names it.
    """
    given = reward_of(task, start[None], end[None], trace and trace[None])
    with suppress(TypeError, ValueError):
        rewards = np.asarray(given, dtype=np.float64)
        if rewards.shape == (1,):
            return float(rewards[0])

    got = shorten(repr(given))
    raise PluginError(
        f"{describe_part(task)}: reward gave {got}; expected an array (1,)"
    )

"""Make trials of what an engine played: look for what is unphysical, reward the end, and observe."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from core.geometry import Array
from core.interfaces import Task
from core.plugins import describe_part
from core.plugins.blame import PluginError
from core.scene import State, Trace
from core.simulation.attempt import Attempt, Stage
from core.simulation.observing import observe
from core.solids.contacts import find_contacts, make_trace
from core.solids.penetration import Explosion, Finding, findings
from core.solids.record_rate import is_finite
from core.task import margins_of, reward_of, shares_of
from core.trial import Trial

_WARNINGS = 10  # findings of a rollout that are listed


def judge_attempts(stage: Stage, attempts: Sequence[Attempt]) -> list[Trial]:
    """Check what was played, and reward it."""
    failures = [_find_failure(stage, attempt) for attempt in attempts]
    finished = [
        attempt
        for attempt, failure in zip(attempts, failures, strict=True)
        if failure is None
    ]
    rewarded = iter(_reward(stage, finished) if finished else [])
    return [
        next(rewarded)
        if why is None
        else Trial(stage.where, attempt.candidate.id, "failed", reason=why)
        for attempt, why in zip(attempts, failures, strict=True)
    ]


def _find_failure(stage: Stage, attempt: Attempt) -> str | None:
    """Find what was unphysical and what touched; say why a rollout failed; None: it did not."""
    outcome = attempt.outcome
    wanted = stage.task.reads_trace or stage.settings.observe
    if outcome is not None and (recording := outcome.recording) is not None:
        try:
            if stage.checks:
                attempt.findings = findings(
                    stage.scene, stage.task.robot, attempt.tool, recording
                )
        except Explosion as explosion:
            return attempt.problem or f"the simulation blew up: {explosion}"
        if wanted and outcome.error is None and is_finite(recording):
            attempt.contacts = find_contacts(
                stage.scene, stage.task.robot, attempt.tool, recording
            )
    if attempt.problem is not None:
        return attempt.problem
    if (
        outcome is None
        or outcome.error is not None
        or outcome.start is None
        or outcome.end is None
    ):
        return (outcome and outcome.error) or "the simulator returned no state"
    if stage.task.reads_trace and attempt.contacts is None:
        return "the reward reads a trace, and the simulator returned no recording of finite states"
    return None


def _reward(stage: Stage, finished: Sequence[Attempt]) -> Iterator[Trial]:
    """Yield the trials of what came to its end."""
    scene = stage.scene
    outcomes = [attempt.outcome for attempt in finished]
    starts, ends = (
        scene.complete(State.stack([getattr(outcome, end) for outcome in outcomes]))
        for end in ("start", "end")
    )
    shifts = np.linalg.norm(ends.positions - starts.positions, axis=-1)
    contacts = [
        attempt.contacts for attempt in finished if attempt.contacts is not None
    ]
    trace = make_trace(scene, contacts) if stage.task.reads_trace else None
    rewards = _rewards(stage.task, starts, ends, trace)
    for number, (attempt, reward, moved) in enumerate(
        zip(finished, rewards.tolist(), shifts.tolist(), strict=True)
    ):
        film = trace[number] if trace is not None else None
        margins = margins_of(stage.task, starts[number], ends[number], film, reward)
        motion = attempt.motion
        outcome = attempt.outcome
        assert outcome is not None
        trial = Trial(
            stage.where,
            attempt.candidate.id,
            "ok",
            reward,
            distance_m=motion.distance_m,
            ik_error_m=motion.ik_error_m,
            ik_error_rad=motion.ik_error_rad,
            tracking_error_rad=outcome.tracking_error_rad,
            motion_s=float(motion.trajectory.duration),
            moved_m=dict(zip(starts.names, moved, strict=True)),
            warnings=(*attempt.warnings, *motion.slowdowns(), *outcome.warnings),
            margins=margins,
            goals=shares_of(stage.task, starts[number], ends[number], film),
        )
        if not 0.0 <= reward <= 1.0:
            reason = f"task {stage.task.name}: the reward {reward} is not in [0, 1]"
            trial = replace(trial, status="failed", reward=0.0, reason=reason)
        yield judge(
            _observe(stage, trial, attempt), attempt.findings, forbid=stage.forbids
        )


def _observe(stage: Stage, trial: Trial, attempt: Attempt) -> Trial:
    """Add what was observed of a rollout, if that is asked for."""
    if (
        not stage.settings.observe
        or attempt.contacts is None
        or attempt.outcome is None
    ):
        return trial
    seen = observe(
        stage.task,
        stage.scene,
        attempt.motion,
        attempt.outcome,
        trial.reward,
        attempt.contacts,
    )
    outcome = f"{seen.result} {seen.what}".strip()
    return replace(trial, touch_m=seen.touch_m, outcome=outcome, observation=seen)


def judge(trial: Trial, found: Sequence[Finding], *, forbid: bool) -> Trial:
    """Add findings to a trial's warnings; with ``forbid``, penetration sets its reward to 0."""
    texts = [finding.text for finding in found]
    more = (
        [f"{len(texts) - _WARNINGS} more such findings"]
        if len(texts) > _WARNINGS
        else []
    )
    warned = replace(trial, warnings=(*trial.warnings, *texts[:_WARNINGS], *more))

    penetrations = [finding.text for finding in found if finding.penetration]
    if not (forbid and penetrations and trial.reward > 0):
        return warned
    reason = (
        f"{penetrations[0]}, so that its reward of {trial.reward:.2f} does not count"
    )
    return replace(warned, reward=0.0, reason=trial.reason or reason)


def _rewards(task: Task, starts: State, ends: State, trace: Trace | None) -> Array:
    """Compute the rewards of many worlds.

    Raises:
        PluginError: the task returned something else; names it.
    """
    count = len(ends.positions)
    rewards = np.asarray(reward_of(task, starts, ends, trace), dtype=np.float64)
    if rewards.shape != (count,):
        raise PluginError(
            f"{describe_part(task)}: reward gave an array of shape {rewards.shape} for {count} worlds; "
            f"expected ({count},)"
        )
    return rewards

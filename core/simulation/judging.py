"""Make trials of what an engine played: look for what is unphysical, reward the end, and observe."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import groupby

import numpy as np

from core.geometry import Array
from core.goals import goals_shares
from core.interfaces import Task
from core.plugins import describe_part
from core.plugins.blame import PluginError
from core.robot.kinematics import arm_of
from core.scene import Scene, State, Trace
from core.simulation.attempt import Attempt, Stage
from core.simulation.measuring import measure
from core.simulation.observing import observe
from core.solids.contacts import (
    Contacts,
    count_instants,
    find_contacts,
    make_trace,
)
from core.solids.penetration import Explosion, Finding, findings
from core.solids.record_rate import is_finite
from core.support.text import number, shorten
from core.task import margins_of, reward_of
from core.trial import NOTHING, Trial

_WARNINGS = 10  # findings of a rollout that are listed

World = tuple[State, State, Trace | None]  # at the start, at the end, and in between


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

    finished = [attempt for attempt in attempts if attempt.trial is None]
    for _, group in groupby(sorted(finished, key=_kin), key=_kin):
        _reward(stage, [*group])


def _kin(attempt: Attempt) -> tuple[int, int]:
    """Tell apart attempts whose designs add something else to the scene, or that last longer.

    In a common trace what ended early would stand still until the others end: a swinging body would be at rest.
    """
    contacts = attempt.contacts
    instants = 0 if contacts is None else count_instants(contacts)

    return id(attempt.scene), instants


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


def _reward(stage: Stage, finished: Sequence[Attempt]) -> None:
    """Make the trials of what came to its end in one scene, as long: the reward is called once for all of them."""
    task = stage.task
    scene = finished[0].scene
    starts = _stack(scene, finished, "start")
    ends = _stack(scene, finished, "end")
    trace = None

    if task.reads_trace:
        contacts = filter(None, [attempt.contacts for attempt in finished])
        trace = make_trace(scene, [*contacts])

    rewards = _rewards(task, starts, ends, trace).tolist()
    for place, attempt in enumerate(finished):
        film = None if trace is None else trace[place]
        world = starts[place], ends[place], film
        attempt.trial = _make_trial(stage, attempt, rewards[place], world)


def _stack(scene: Scene, finished: Sequence[Attempt], moment: str) -> State:
    """Stack the states of all worlds at a ``moment``: start or end."""
    states = [getattr(attempt.outcome, moment) for attempt in finished]
    return scene.complete(State.stack(states))


def _make_trial(
    stage: Stage,
    attempt: Attempt,
    reward: float,
    world: World,
) -> Trial:
    """Make the trial of an attempt that came to its end.

    Args:
        stage: the condition in which it was tried.
        attempt: what was played, and what was found in it.
        reward: what the task pays.
        world: its states and its trace.
    """
    task = stage.task
    motion = attempt.motion
    outcome = attempt.outcome
    start, end, _ = world
    shifts = np.linalg.norm(end.positions - start.positions, axis=-1).tolist()

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
            *texts,
        ),
        margins=margins_of(task, *world, reward),
        goals=goals_shares(task, *world),
        measured=measure(task, motion, outcome),
        torques=arm_of(task.robot).share_torques(outcome.torques),
    )
    if not 0.0 <= reward <= 1.0:
        reason = f"task {task.name}: the reward {reward} is not in [0, 1]"
        trial = replace(trial, status="failed", reward=0.0, solved=False, reason=reason)

    return _forbid_penetration(stage, _observe(stage, trial, attempt), attempt.findings)


def _observe(stage: Stage, trial: Trial, attempt: Attempt) -> Trial:
    """Add what was observed of a rollout, if that is asked for or if the task pays nothing: that has a cause."""
    if trial.reward >= NOTHING and not stage.settings.observe:
        return trial

    if attempt.contacts is None and _look_for_contacts(stage, attempt) is None:
        return trial

    seen = observe(stage.task, attempt, trial)
    text = f"{seen.result} {seen.what}".strip()
    return replace(trial, touch_m=seen.touch_m, outcome=text, observation=seen)


def _forbid_penetration(stage: Stage, trial: Trial, found: Sequence[Finding]) -> Trial:
    """Set the reward of a trial to 0 for penetration, where that is forbidden; ``found`` is what was unphysical."""
    passages = [finding.text for finding in found if finding.penetration]
    forbidden = stage.settings.penetration == "forbid" and passages

    if not forbidden or trial.reward <= 0:
        return trial

    counts = f"so that its reward of {number(trial.reward, 2)} does not count"
    reason = trial.reason or f"{passages[0]}, {counts}"
    return replace(trial, reward=0.0, solved=False, reason=reason)


def _rewards(
    task: Task,
    starts: State,
    ends: State,
    trace: Trace | None,
) -> Array:
    """Compute the rewards of many worlds.

    Args:
        task: pays them.
        starts: the states at the start, of W worlds.
        ends: those at the end.
        trace: what happened in between, if the task reads it.

    Returns:
        Rewards (W,).

    Raises:
        PluginError: the task returned something else; names it.
    """
    shape = (len(ends.positions),)
    given = reward_of(task, starts, ends, trace)
    with suppress(TypeError, ValueError):
        rewards = np.asarray(given, dtype=np.float64)
        if rewards.shape == shape:
            return rewards

    got = shorten(repr(given))
    raise PluginError(
        f"{describe_part(task)}: reward gave {got}; expected an array {shape}"
    )

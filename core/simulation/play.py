"""Play candidates in a condition: from a tool and its plan to a trial. It is the only door to physics.

Plan the motion and check it (`core.simulation.attempt`), let the engine play it, and make trials of what it played
(`core.simulation.judging`). Engines only play what is prepared here.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from core.design import Candidate, Tool
from core.errors import RAISED, SharedByThreads, UserError
from core.interfaces import Outcome, Rollout, Waypoints
from core.plugins import describe_part
from core.plugins.blame import PluginError, describe_failure
from core.simulation.attempt import (
    Attempt,
    Stage,
    follow_reactions,
    plan_attempt,
    stage_of,
)
from core.simulation.forks import begin_at_fork
from core.simulation.judging import judge_attempts
from core.support.text import number, shorten
from core.trial import NOTHING, Condition, Trial

_playing = threading.RLock()


def play(condition: Condition, candidates: Sequence[Candidate]) -> list[Trial]:
    """Try candidates in a condition, and return a complete trial of each, in order.

    Of a candidate with a plan for each of several tasks the plan for this one is played.

    One thread of a process plays at a time. Engines and arms are made once for all of them, and compute in place.

    Raises:
        PluginError: the code of the task or the simulator raised something; names the plugin.
        SharedByThreads: another thread of this process plays.
    """
    if not _playing.acquire(blocking=False):
        raise SharedByThreads(
            "two threads of one process play at once, and would spoil each other's rollouts: let workers be "
            "processes, or play one chunk after the other"
        )

    try:
        return _play(stage_of(condition), candidates)
    except (UserError, MemoryError):
        raise
    except RAISED as error:  # a plugin's code may raise anything
        blamed = describe_failure(error)
        if blamed is None:
            raise
        raise PluginError(blamed) from error
    finally:
        _playing.release()


def _play(stage: Stage, candidates: Sequence[Candidate]) -> list[Trial]:
    """Try each candidate, and return their trials, in order."""
    condition = stage.condition
    examiner = condition.examiner
    trials = []

    for candidate, attempt in zip(candidates, _try(stage, candidates), strict=True):
        trial = _deduct_fixture(stage, candidate, attempt)
        if examiner is not None and trial.status == "ok":
            trial = examiner.examine(condition, candidate, trial)

        trials.append(trial)

    return trials


def _try(stage: Stage, candidates: Sequence[Candidate]) -> list[Attempt]:
    """Try each candidate, and return the attempts with their trials, in order."""
    attempts = [plan_attempt(stage, candidate) for candidate in candidates]
    for attempt in attempts:
        if attempt.trial is None and attempt.candidate.fork is not None:
            attempt.job = begin_at_fork(stage, attempt.candidate.fork, attempt.job)

    planned = [attempt for attempt in attempts if attempt.trial is None]
    outcomes = _run_engine(stage, [attempt.job for attempt in planned])

    for attempt, outcome in zip(planned, outcomes, strict=True):
        attempt.outcome = outcome
        follow_reactions(stage, attempt)

    judge_attempts(stage, planned)
    return attempts


def _deduct_fixture(stage: Stage, candidate: Candidate, attempt: Attempt) -> Trial:
    """Take from what a design earns what its fixture alone adds to the scene while the arm is idle."""
    trial = attempt.trial
    assert trial is not None
    fixture = None if candidate.tool is None else candidate.tool.fixture
    if fixture is None or trial.reward < NOTHING:
        return trial

    # Plans that last about as long share a trial.
    seconds = max(attempt.motion.trajectory.duration, 1.0)
    wait_s = 2.0 ** math.ceil(math.log2(seconds))
    earned = _earn_idle(stage.condition, Tool(fixture=fixture), wait_s)
    if earned >= NOTHING:
        earned -= _earn_idle(stage.condition, Tool(), wait_s)
    if earned < NOTHING:
        return trial

    said = f"the fixture alone earns {number(earned, 2)} while the arm is idle, and that does not count"
    left = max(trial.reward - earned, 0.0)
    if left < NOTHING:
        return replace(trial, reward=0.0, solved=False, reason=trial.reason or said)

    solved = trial.solved and stage.task.is_paid(left)
    warnings = (*trial.warnings, said)
    return replace(trial, reward=left, solved=solved, warnings=warnings)


@lru_cache(maxsize=256)
def _earn_idle(condition: Condition, tool: Tool, wait_s: float) -> float:
    """Try what a condition pays for waiting at home, so many seconds."""
    settings = condition.settings
    settings = replace(settings, hold_s=settings.hold_s + wait_s)
    waiting = replace(condition, settings=settings, examiner=None)
    stage = stage_of(waiting)
    home = stage.task.home
    pose = [*home.position, *home.rpy]
    candidate = Candidate(tool, Waypoints(np.array([pose])))
    (attempt,) = _try(stage, [candidate])
    assert attempt.trial is not None
    return attempt.trial.reward


def _run_engine(stage: Stage, jobs: Sequence[Rollout]) -> list[Outcome]:
    """Let the engine play the jobs, one outcome for each.

    Raises:
        PluginError: the simulator returned something else; names it.
    """
    simulator = stage.simulator
    outcomes = simulator.rollout(stage.task, jobs)
    listed = isinstance(outcomes, list) and len(outcomes) == len(jobs)
    if listed and all(isinstance(outcome, Outcome) for outcome in outcomes):
        return outcomes

    got = shorten(repr(outcomes))
    raise PluginError(
        f"{describe_part(simulator)}: rollout gave {got}; expected a list of Outcome, one for each of {len(jobs)} jobs"
    )

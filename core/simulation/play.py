"""Play candidates in a condition: from a tool and its plan to a trial. It is the only door to physics.

Plan the motion and check it (`core.simulation.attempt`), let the engine play it, and make trials of what it played
(`core.simulation.judging`). Engines only play what is prepared here.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence

from core.design import Candidate
from core.errors import RAISED, SharedByThreads, UserError
from core.interfaces import Outcome, Rollout
from core.plugins import describe_part
from core.plugins.blame import PluginError, describe_failure
from core.simulation.attempt import Stage, follow_reactions, plan_attempt, stage_of
from core.simulation.judging import judge_attempts
from core.support.text import shorten
from core.trial import Condition, Trial

_playing = threading.RLock()


def play(condition: Condition, candidates: Sequence[Candidate]) -> list[Trial]:
    """Try candidates in a condition, and return a complete trial of each, in order.

    Of a candidate with a plan for each of several tasks the plan for this one is played. One call of the task's reward
    covers all worlds.

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
    attempts = [plan_attempt(stage, candidate) for candidate in candidates]
    planned = [attempt for attempt in attempts if attempt.trial is None]
    outcomes = _run_engine(stage, [attempt.job for attempt in planned])

    for attempt, outcome in zip(planned, outcomes, strict=True):
        attempt.outcome = outcome
        follow_reactions(stage, attempt)

    judge_attempts(stage, planned)

    condition = stage.condition
    examiner = condition.examiner
    trials = []

    for candidate, attempt in zip(candidates, attempts, strict=True):
        trial = attempt.trial
        assert trial is not None
        if examiner is not None and trial.status == "ok":
            trial = examiner.examine(condition, candidate, trial)

        trials.append(trial)

    return trials


def _run_engine(stage: Stage, jobs: Sequence[Rollout]) -> list[Outcome]:
    """Let the engine play the jobs, one outcome for each.

    Raises:
        PluginError: the simulator returned something else; names it.
    """
    simulator = stage.simulator
    outcomes = simulator.rollout(stage.task, jobs)
    got = None
    listed = isinstance(outcomes, list)

    if not listed or not all(isinstance(outcome, Outcome) for outcome in outcomes):
        got = f"{shorten(repr(outcomes))}; expected a list of Outcome"
    elif len(outcomes) != len(jobs):
        got = f"{len(outcomes)} outcomes for {len(jobs)} jobs"

    if got is not None:
        raise PluginError(f"{describe_part(simulator)}: rollout gave {got}")

    return outcomes

"""Play candidates in a condition: from a tool and its plan to a trial. It is the only door to physics.

Plan the motion and check it (`core.simulation.attempt`), let the engine play it, and make trials of what it played
(`core.simulation.judging`). Engines only play what is prepared here.
"""

from __future__ import annotations

from collections.abc import Sequence

from core.design import Candidate
from core.errors import RAISED, UserError
from core.interfaces import Outcome, Rollout, Simulator, Task
from core.plugins import describe_part
from core.plugins.blame import PluginError, describe_failure
from core.simulation.attempt import Attempt, Stage, follow_guards, plan_attempt
from core.simulation.judging import judge_attempts
from core.simulation.observing import MISSED_M, MISSED_RAD
from core.support.text import shorten
from core.trial import Condition, Trial


def play(condition: Condition, candidates: Sequence[Candidate]) -> list[Trial]:
    """Try candidates in a condition, and return a complete trial of each, in order.

    Of a candidate with a plan for each of several tasks the plan for this one is played. One call of the task's reward
    covers all worlds.

    Raises:
        PluginError: the code of the task or the simulator raised something; names the plugin.
    """
    try:
        return _play(Stage(condition), candidates)
    except (UserError, MemoryError):
        raise
    except RAISED as error:  # a plugin's code may raise anything
        blamed = describe_failure(error)
        if blamed is None:
            raise
        raise PluginError(blamed) from error


def find_problems(condition: Condition, candidate: Candidate) -> list[str]:
    """Say what is wrong with a candidate in a condition, without playing it.

    That is why it would be rejected, or else which waypoints the arm misses or is late at, and where it meets itself.
    """
    planned = plan_attempt(Stage(condition), candidate)
    if isinstance(planned, Trial):
        return [planned.reason]

    motion = planned.motion
    problems = []
    for number, (metres, radians) in enumerate(motion.misses.tolist(), start=1):
        if metres > MISSED_M or radians > MISSED_RAD:
            miss = f"{1000 * metres:.0f} mm, {radians:.2f} rad"
            problems.append(f"the arm misses the way to waypoint {number} by {miss}")

    return [*problems, *motion.slowdowns(), *planned.warnings]


def _play(stage: Stage, candidates: Sequence[Candidate]) -> list[Trial]:
    """Try each candidate, and return their trials, in order."""
    planned = [plan_attempt(stage, candidate) for candidate in candidates]
    attempts = [step for step in planned if isinstance(step, Attempt)]
    jobs = [attempt.job for attempt in attempts]
    outcomes = _run_engine(stage.simulator, stage.task, jobs)
    for attempt, outcome in zip(attempts, outcomes, strict=True):
        attempt.outcome = outcome
        follow_guards(stage, attempt)

    played = iter(judge_attempts(stage, attempts))

    condition = stage.condition
    examiner = condition.examiner
    trials = []
    for candidate, step in zip(candidates, planned, strict=True):
        trial = next(played) if isinstance(step, Attempt) else step
        if examiner is not None and trial.status == "ok":
            trial = examiner.examine(condition, candidate, trial)
        trials.append(trial)

    return trials


def _run_engine(
    simulator: Simulator, task: Task, jobs: Sequence[Rollout]
) -> list[Outcome]:
    """Let the engine play the jobs, one outcome for each.

    Raises:
        PluginError: the simulator returned something else; names it.
    """
    outcomes = simulator.rollout(task, jobs)
    listed = isinstance(outcomes, list)
    if not listed or not all(isinstance(outcome, Outcome) for outcome in outcomes):
        got = f"{shorten(repr(outcomes))}; expected a list of Outcome"
        raise PluginError(f"{describe_part(simulator)}: rollout gave {got}")

    if len(outcomes) != len(jobs):
        got = f"{len(outcomes)} outcomes for {len(jobs)} jobs"
        raise PluginError(f"{describe_part(simulator)}: rollout gave {got}")

    return outcomes

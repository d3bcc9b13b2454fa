"""Go on from where an earlier candidate was at a waypoint: its beginning is played once, and stored."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from core.design import Fork
from core.interfaces import Ability, Checkpoint, Rollout
from core.simulation.attempt import Stage, plan_attempt

_KEPT = 16  # states of worlds, some megabytes each


def begin_at_fork(stage: Stage, fork: Fork, job: Rollout) -> Rollout:
    """Let a job begin where its candidate's fork is; where there is no way to that, it stays as it is."""
    if Ability.FORKS not in stage.simulator.supports:
        return job
    return replace(job, begins=_reach(stage, fork, job.record_hz, job.forces))


@lru_cache(maxsize=_KEPT)
def _reach(
    stage: Stage, fork: Fork, record_hz: float, forces: bool
) -> Checkpoint | None:
    """Play the earlier candidate up to the waypoint; None: it was refused here, or does not get there."""
    planned = plan_attempt(stage, fork.candidate)
    if planned.trial is not None:
        return None

    job = replace(planned.job, record_hz=record_hz, forces=forces)
    arrivals = planned.motion.arrivals
    if job.reactions is not None:  # when it gets there is known once it is played
        (outcome,) = stage.simulator.rollout(stage.task, [job])
        if outcome.error is not None:
            return None
        arrivals = job.reactions.motion.arrivals

    if not 1 <= fork.waypoint <= len(arrivals):
        return None
    instant = float(arrivals[fork.waypoint - 1])
    return stage.simulator.stop_at(stage.task, job, instant)

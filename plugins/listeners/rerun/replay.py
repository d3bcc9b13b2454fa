"""A candidate's rollout, repeated to be recorded."""

from __future__ import annotations

import numpy as np

from core.design import Candidate
from core.events import Run
from core.geometry import Array
from core.interfaces import Recording
from core.scene import State
from core.simulation.rollout import prepare


def replay(run: Run, candidate: Candidate, hz: float) -> tuple[Recording, Array]:
    """Play a candidate in the run's own simulator, in this process.

    Returns:
        The recording over instants (T,), and the reward (T,) if it ended there, nan while the scene settles.

    Raises:
        ValueError: the rollout breaks, or the run has no simulator.
    """
    if run.simulator is None:
        raise ValueError("the run has no simulator to play it with")
    _, job = prepare(run.task, candidate, run.seed, run.settings, record_hz=hz)
    outcome = run.simulator.rollout(run.task, [job])[0]
    recording, start = outcome.recording, outcome.start
    if recording is None or start is None:
        raise ValueError(outcome.error or "no recording came back")
    starts = State.stack([start] * len(recording.times))
    rewards = np.asarray(run.task.reward(starts, recording.states), dtype=np.float64)
    return recording, np.where(recording.times >= 0, rewards, np.nan)

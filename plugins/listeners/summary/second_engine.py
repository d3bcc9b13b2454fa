"""Say what the winner of a run earned in a second engine."""

from __future__ import annotations

from core.interfaces import Trial
from core.support.text import clean, number

LONGEST = 600  # letters of a cause


def describe_second_engine(trial: Trial) -> str:
    """Say what the winner earned in a second engine, or that it could not be tried there."""
    if trial.status == "failed" and not trial.measured:
        return f"the best could not be tried in {trial.engine}"

    return f"in {trial.engine} it earns {number(trial.reward, 3)}"


def explain_second_engine(trial: Trial) -> str:
    """Say that, and why it did not solve the task there, if so."""
    cause = "" if trial.solved else clean(trial.cause, LONGEST)
    outcome = describe_second_engine(trial)
    return f"{outcome}: {cause}" if cause else outcome

"""Play small worlds of bodies, and take what an outcome holds."""

from __future__ import annotations

from typing import Any

from core.interfaces import Outcome, Recording, Simulator
from core.scene import Body, State
from plugins.conformance.worlds import motion, watch


def wait(
    simulator: Simulator, *bodies: Body, seconds: float = 1.0, **job: Any
) -> Outcome:
    """Simulate bodies while the arm stays at home."""
    job = {"record_hz": 0.0, **job}
    return watch(simulator, *bodies, hold_s=seconds, **job).outcome


def move(simulator: Simulator, plan: object, *bodies: Body, **job: Any) -> Outcome:
    """Simulate a motion through waypoints."""
    job = {"settle_s": 0.1, "hold_s": 0.5, "record_hz": 0.0, **job}
    return watch(simulator, *bodies, way=motion(plan), **job).outcome


def start(outcome: Outcome) -> State:
    assert outcome.start is not None
    return outcome.start


def end(outcome: Outcome) -> State:
    assert outcome.end is not None
    return outcome.end


def film(outcome: Outcome) -> Recording:
    assert outcome.recording is not None
    return outcome.recording

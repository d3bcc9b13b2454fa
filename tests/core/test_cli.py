"""Signals, one after the other."""

import math
import signal

import pytest

from core import cli


@pytest.fixture
def signals(monkeypatch):
    """What the time is, and what the process was left with; None: it was not."""
    happened = {"time": 100.0, "left": None}
    monkeypatch.setattr(cli._Interrupt, "first", math.inf)
    monkeypatch.setattr(cli.time, "monotonic", lambda: happened["time"])
    monkeypatch.setattr(cli.os, "_exit", lambda code: happened.update(left=code))
    return happened


def test_the_first_signal_is_an_interrupt(signals):
    with pytest.raises(KeyboardInterrupt):
        cli._Interrupt()(signal.SIGTERM, None)
    assert signals["left"] is None


def test_the_same_signal_to_the_process_and_its_group_is_one(signals):
    """As timeout sends it; the second must not end what puts things in order."""
    with pytest.raises(KeyboardInterrupt):
        cli._Interrupt()(signal.SIGTERM, None)
    signals["time"] += 0.5
    cli._Interrupt()(signal.SIGINT, None)
    assert signals["left"] is None


def test_whoever_asks_again_need_not_wait(signals):
    with pytest.raises(KeyboardInterrupt):
        cli._Interrupt()(signal.SIGINT, None)
    signals["time"] += 1.5
    cli._Interrupt()(signal.SIGINT, None)
    assert signals["left"] == 130

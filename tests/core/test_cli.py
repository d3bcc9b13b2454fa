"""Signals, one after the other; who listens no more; what help does without."""

import math
import os
import signal
import subprocess
import sys

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


@pytest.mark.parametrize("words", [["core.plugins"], ["core.run", "--help"], ["core.evaluate", "--help"]], ids=" ".join)
@pytest.mark.parametrize("buffering", [[], ["-u"]], ids=["buffered", "unbuffered"])
def test_nobody_reads_the_output_any_more(words, buffering):
    """As with ``| head``."""
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as output:
        done = subprocess.run([sys.executable, *buffering, "-m", *words], stdout=output, stderr=subprocess.PIPE)
    assert (done.returncode, done.stderr) == (1, b"")


SLOW = {
    "scipy",
    "trimesh",
    "coal",
    "pinocchio",
    "matplotlib",
    "rerun",
    "mujoco",
    "pybullet",
    "sapien",
    "litellm",
    "ray",
}


@pytest.mark.parametrize("words", [["core.run", "--help"], ["core.plugins"]], ids=" ".join)
def test_what_is_told_without_a_run_imports_nothing_of_one(words):
    program = f"""
import atexit, runpy, sys
atexit.register(lambda: sys.stderr.write(" ".join({SLOW} & sys.modules.keys())))
sys.argv = {words}
runpy.run_module({words[0]!r}, run_name="__main__", alter_sys=True)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert "BringCube" in done.stdout
    assert (done.returncode, done.stderr) == (0, "")

"""Signals end a command, whatever it is doing when they come."""

import signal
import subprocess
import sys

import pytest

from core.support import interrupts
from tests.support.processes import PATIENCE_S


@pytest.fixture
def signals(monkeypatch):
    """The time, and the status that the process ended with; None: it did not end."""
    happened = {"time": 100.0, "left": None}
    monkeypatch.setattr(interrupts.time, "monotonic", lambda: happened["time"])
    monkeypatch.setattr(interrupts, "_exit", lambda code: happened.update(left=code))
    # Engines of other tests keep files there.
    monkeypatch.setattr(interrupts, "remove_scratch", lambda: None)
    return happened


@pytest.mark.parametrize(("after_s", "left"), [(0.5, None), (1.5, 130)])
def test_a_signal_is_an_interrupt_and_a_second_one_ends_the_process(
    signals, after_s, left
):
    """Unless it is the same one, to the process and its group, as timeout sends it: what tidies up goes on."""
    interrupt = interrupts.Interrupts(print)
    with pytest.raises(KeyboardInterrupt):
        interrupt(signal.SIGTERM, None)
    assert signals["left"] is None
    signals["time"] += after_s
    interrupt(signal.SIGINT, None)
    assert signals["left"] == left


LOST = """
import os, signal
from core.support.cli import command

class Swallowing:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGTERM)
        [None for _ in range(1000)]  # Python looks at signals here

def begin(words, made=[Swallowing()]):
    made.clear()
    while True:
        pass

command(begin)
"""

SWALLOWED = """
import os, signal
from core.support.cli import command
from core.support.interrupts import check_interrupt

def main(words):
    try:
        os.kill(os.getpid(), signal.SIGTERM)
        while True:
            pass
    except BaseException:
        pass
    while True:
        check_interrupt()

command(main)
"""

IN_A_LIBRARY = """
import hashlib, os, signal, threading
from core.support.cli import command
from core.support.interrupts import resumable

def main(words):
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGTERM)).start()
    with resumable("to go on: again"):
        hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)  # minutes, and Python looks at no signal

command(main)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "said"),
    [
        (LOST, "interrupted\n"),
        (SWALLOWED, "interrupted\n"),
        (IN_A_LIBRARY, "interrupted; to go on: again\n"),
    ],
    ids=["in a destructor", "swallowed", "in a library"],
)
def test_a_signal_ends_what_would_go_on_without_end(script, said):
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert (done.returncode, done.stderr) == (130, said)

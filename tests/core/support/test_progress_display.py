"""What takes long is said, and what does not is not."""

import re
import subprocess
import sys
import time

import pytest

from core.support import progress_display

SLOW = """
import time
from core.support import progress_display
from core.support.cli import command, say

progress_display.FIRST_S = 0.3

def main(words):
    with progress_display.busy("reading a\x1b[2J.obj"):
        time.sleep(1.0)
    say("done")

command(main)
"""


@pytest.fixture
def said(monkeypatch):
    """The lines that a display shows, in the time of this test."""
    lines = []
    monkeypatch.setattr(progress_display, "FIRST_S", 0.2)
    monkeypatch.setattr(progress_display, "LOOK_S", 0.01)
    progress_display.show_progress(lines.append)
    return lines


def wait_for(said, count):
    for _ in range(500):
        if len(said) >= count:
            return
        time.sleep(0.01)


def test_what_takes_long_is_said_more_and_more_rarely(said):
    with progress_display.busy("making hulls") as step:
        wait_for(said, 1)
        step.what = "making the last hull"
        wait_for(said, 2)
    assert said == ["making hulls ...", "making the last hull ..."]


def test_what_is_said_again_says_how_long_it_has_taken(said):
    with progress_display.busy("drawing"):
        wait_for(said, 2)
    first, again = said
    assert first == "drawing ..."
    assert re.fullmatch(r"drawing \.\.\. \d+ s", again)


def test_what_is_quick_is_not_said(said):
    with progress_display.busy("reading"):
        time.sleep(0.05)
    time.sleep(0.05)
    assert not said


def test_steps_that_follow_each_other_are_one_piece_of_work(said):
    for number in range(100):
        with progress_display.busy(f"mesh {number}"):
            time.sleep(0.01)
        if said:
            break
    assert said[0].startswith("mesh ")


def test_without_a_command_nothing_is_said(capsys, monkeypatch):
    monkeypatch.setattr(progress_display, "FIRST_S", 0.0)
    monkeypatch.setattr(progress_display, "LOOK_S", 0.01)
    with progress_display.busy("reading"):
        time.sleep(0.1)
    assert capsys.readouterr() == ("", "")


def test_in_a_pipe_lines_stay():
    done = subprocess.run([sys.executable, "-c", SLOW], capture_output=True, text=True)
    assert done.stdout == "done\n"
    assert done.stderr.startswith(r"reading a\x1b[2J.obj ...")

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from core.errors import UserError
from core.support.scratch import intact, scratch, temporary_folder, write_once

PROGRAM = """
import os, signal, sys
from pathlib import Path
from core.support.cli import command
from core.errors import UserError
from core.support.scratch import scratch

def main(words):
    (scratch() / "a" / "b").mkdir(parents=True)
    print(scratch(), flush=True)
    match sys.argv[1]:
        case "raise": raise ValueError("a bug")
        case "refuse": raise UserError("a mistake")
        case "interrupt": os.kill(os.getpid(), signal.SIGINT)
        case "kill": os.kill(os.getpid(), signal.SIGKILL)
        case "exit": os._exit(3)
        case "fork" if os.fork() == 0: sys.exit(0)
    if sys.argv[1] == "fork":
        os.wait()
        assert scratch().is_dir()

command(main)
"""


def ended(folder, way):
    """Run the program, which ends in this way; return its folder."""
    environment = os.environ | {"TMPDIR": str(folder)}
    done = subprocess.run([sys.executable, "-c", PROGRAM, way], env=environment, capture_output=True, text=True)
    assert "AssertionError" not in done.stderr
    made = Path(done.stdout.split()[0])
    assert made.parent == folder
    return made


@pytest.mark.parametrize("way", ["return", "raise", "refuse", "interrupt", "fork"])
def test_a_process_that_ends_leaves_no_folder(way, tmp_path):
    ended(tmp_path, way)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("way", ["kill", "exit"])
def test_neither_does_one_that_is_killed(way, tmp_path):
    ended(tmp_path, way)
    deadline = time.monotonic() + 20
    while list(tmp_path.iterdir()) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_deleted_is_made_again(monkeypatch, tmp_path):
    monkeypatch.setattr("core.support.scratch._roots", [])
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    first = scratch()
    assert scratch() == first
    first.rmdir()
    assert scratch().is_dir()
    first.mkdir(exist_ok=True)  # it may be another user's
    assert scratch() != first


def test_no_room_is_a_line(monkeypatch, tmp_path):
    monkeypatch.setattr("core.support.scratch._roots", [])
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    with pytest.raises(UserError, match=r"no temporary folder can be made: .*; make room, or set TMPDIR"):
        temporary_folder()


def test_a_file_is_written_once_and_again_where_it_was_changed(tmp_path):
    made = []

    def make():
        made.append("text")
        return "text"

    file = tmp_path / "a.txt"
    for _ in range(2):
        assert write_once(file, make).read_text() == "text"
    assert len(made) == 1
    with intact(tmp_path):
        pass
    file.write_text("tex")
    assert write_once(file, make).read_text() == "text"

    def play():
        with intact(tmp_path):
            file.unlink()
            raise ArithmeticError("what an engine makes of it")

    with pytest.raises(FileNotFoundError, match="a temporary file was deleted"):
        play()
    assert write_once(file, make).read_text() == "text"


def test_a_file_that_was_written_in_part_is_not_taken_for_whole(tmp_path, monkeypatch):
    """As where a disk is full."""
    file, write = tmp_path / "a.txt", Path.write_text

    def half(self, text):
        write(self, text[: len(text) // 2])
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(Path, "write_text", half)
        with pytest.raises(OSError, match="No space"):
            write_once(file, lambda: "text")
    assert write_once(file, lambda: "text").read_text() == "text"


def test_signals_that_end_a_process_are_not_caught_by_the_remover(tmp_path):
    """A scheduler signals the whole group, and the process needs its folder until it ends."""
    program = "import sys; from core.support.scratch import scratch; print(scratch(), flush=True); sys.stdin.read()"
    command = [sys.executable, "-c", program]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "start_new_session": True}
    with subprocess.Popen(command, env=os.environ | {"TMPDIR": str(tmp_path)}, **pipes) as process:
        folder = Path(process.stdout.readline().strip())
        assert folder.is_dir()
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        deadline = time.monotonic() + 20
        while folder.exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        assert not folder.exists()

import os
import subprocess
import sys
from pathlib import Path

import pytest

from core.errors import UserError
from core.support.scratch import scratch, write_once

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
        case "fork" if os.fork() == 0: sys.exit(0)
    if sys.argv[1] == "fork":
        os.wait()
        assert scratch().is_dir()

command(main)
"""


def ended(folder, way):
    """Run the program, which ends in this way; return its folder."""
    environment = os.environ | {"TMPDIR": str(folder)}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, way],
        env=environment,
        capture_output=True,
        text=True,
    )
    assert "AssertionError" not in done.stderr
    made = Path(done.stdout.split()[0])
    assert made.parent == folder
    return made


@pytest.mark.parametrize("way", ["return", "raise", "refuse", "interrupt", "fork"])
def test_a_process_that_ends_leaves_no_folder(way, tmp_path):
    ended(tmp_path, way)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_deleted_is_made_again(monkeypatch, tmp_path):
    monkeypatch.setattr("core.support.scratch._folder", tmp_path / "scratch")
    first = scratch()
    assert scratch() == first
    first.rmdir()
    assert scratch().is_dir()


def test_no_room_is_a_line(monkeypatch, tmp_path):
    monkeypatch.setattr("core.support.scratch._folder", None)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "missing"))
    with pytest.raises(
        UserError,
        match=r"no temporary folder can be made: .*; make room, or set TMPDIR",
    ):
        scratch()


def test_a_file_is_written_once_and_again_where_it_was_changed(tmp_path):
    made = []

    def make():
        made.append("text")
        return "text"

    file = tmp_path / "a.txt"
    for _ in range(2):
        assert write_once(file, make).read_text() == "text"
    assert len(made) == 1
    file.unlink()
    assert write_once(file, make).read_text() == "text"


def test_a_file_that_was_written_in_part_is_not_taken_for_whole(tmp_path, monkeypatch):
    """As where a disk is full."""
    file = tmp_path / "a.txt"

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", full)
        with pytest.raises(OSError, match="No space"):
            write_once(file, lambda: "text")
    assert write_once(file, lambda: "text").read_text() == "text"

"""``python -m tests.kills FOLDER N [WORD ...]``: one run with toys, several models and a critic, and N more that are
killed at different moments and resumed. Words are settings of all of them.

It is a separate process because it forks, which saves starting Python for each run. A moment is the beginning of an
operation on the disk: an SQL statement, a file that is written, renamed or made, a line in the notes. FOLDER gets
``whole/`` and ``0/``, ``1/`` ..., each with ``run/``, ``notes``, and ``killed/``, the store as the kill left it. Until
then replies are received before candidates are tried, in one thread, so that moments have the same order in all runs.
Each is killed again while it is resumed, with its threads.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import sqlite3
import sys
import time
import traceback
from collections.abc import Sequence
from pathlib import Path

from omegaconf import OmegaConf

import core.search.designer
import plugins.vlms.ensemble.model
from core.plugins import installed
from core.search.orchestration import resume, run
from tests.toys import Notes, offer, several


class Moments:
    """Count moments, and kill the process when number ``last`` begins."""

    def __init__(self, folder: Path, last: int | None) -> None:
        self.folder = str(folder)
        self.last = last
        self.number = 0
        self.connect = sqlite3.connect
        sqlite3.connect = self.connected
        sys.addaudithook(self.audit)

    def connected(self, *arguments, **settings):
        connection = self.connect(*arguments, **settings)
        connection.set_trace_callback(lambda _: self.begin())
        return connection

    def audit(self, event, arguments):
        if event in ("open", "os.rename", "os.mkdir", "os.remove") and str(
            arguments[0]
        ).startswith(self.folder):
            writes = event != "open" or arguments[2] & (os.O_WRONLY | os.O_RDWR)
            if writes:
                self.begin()

    def begin(self):
        self.number += 1
        if self.number == self.last:
            os.kill(os.getpid(), signal.SIGKILL)


def run_at_once(function, ended, name):
    """Stand in for `core.support.threads.run_in_thread`, in the caller's thread."""
    try:
        function()
    except Exception as error:
        ended(error)
    else:
        ended(None)


def session(
    folder: Path, words: Sequence[str], *, resumed: bool, last: int | None
) -> int:
    """Run or resume in a forked process; return the number of moments, or 0 if it was killed."""
    Notes(str(folder / "notes")).add("session")
    count = folder / "moments"
    child = os.fork()
    if child == 0:
        code = 1
        try:
            moments = Moments(folder, last)
            with (
                Path(os.devnull).open("w") as nowhere,
                contextlib.redirect_stdout(nowhere),
            ):
                if resumed:
                    resume(folder / "run")
                else:
                    core.search.designer.run_in_thread = run_at_once
                    plugins.vlms.ensemble.model.run_in_thread = run_at_once
                    run(several(folder / "notes", *words), folder / "run")
            count.write_text(str(moments.number))
            code = 0
        except BaseException:  # the child must end here in any case
            traceback.print_exc()
        os._exit(code)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        assert os.WTERMSIG(status) == signal.SIGKILL
        return 0
    assert os.WEXITSTATUS(status) == 0
    return int(count.read_text())


def main(folder: Path, points: int, words: Sequence[str]) -> None:
    offer(installed())
    # What trials took, and others saved, is stored, and differs from run to run.
    time.process_time = lambda: 0.0
    warm = folder / "warm"
    # What it leaves in caches, each child inherits.
    run(several(warm / "notes", *words), warm / "run")
    (folder / "whole").mkdir()
    moments = session(folder / "whole", words, resumed=False, last=None)
    for point in range(points):
        at = folder / str(point)
        note_config(at, words)
        last = 1 + point * (moments - 2) // max(points - 1, 1)
        assert session(at, words, resumed=False, last=last) == 0
        (at / "killed").mkdir()
        for file in (at / "run").glob("run.sqlite*"):
            shutil.copy(file, at / "killed")
        session(at, words, resumed=True, last=(moments - last) // 2)
        assert session(at, words, resumed=True, last=None) > 0


def note_config(at: Path, words: Sequence[str]) -> None:
    """Write the configuration as Hydra does before a run begins."""
    (at / "run" / ".hydra").mkdir(parents=True)
    OmegaConf.save(several(at / "notes", *words), at / "run" / ".hydra" / "config.yaml")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])

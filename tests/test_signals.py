"""Real runs that are interrupted, terminated and killed: their messages, what they leave, and how they go on."""

import contextlib
import json
import os
import pty
import re
import shlex
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from tests.support.processes import (
    PATIENCE_S,
    SMALL,
    all_gone,
    family,
    finished,
    go_on,
    left_in,
    start,
    stored,
    temporary_in,
    wait_until,
)
from tests.support.runs import assert_same_run

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
# --- Ctrl-C -----------------------------------------------------------------------------------------------------


class Terminal:
    """A run at a terminal, whose output is read as it comes."""

    def __init__(self, folder, *words):
        self.ours, theirs = pty.openpty()
        command = [sys.executable, "-m", "core.run", *words]
        environment = temporary_in(folder / "temporary") | {
            "TERM": "xterm",
            "COLUMNS": "200",
        }
        self.run = subprocess.Popen(
            command,
            cwd=folder,
            env=environment,
            preexec_fn=lambda: os.login_tty(theirs),
        )
        os.close(theirs)
        self.said = b""
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()

    def read(self):
        with contextlib.suppress(OSError):  # the other end is closed
            while data := os.read(self.ours, 4096):
                self.said += data

    def type(self, key):
        os.write(self.ours, key)

    def end(self):
        """Wait for the end; return the exit code and all output."""
        code = self.run.wait(PATIENCE_S)
        self.reader.join(PATIENCE_S)
        os.close(self.ours)
        return code, self.said.decode()


@pytest.mark.thorough
def test_ctrl_c_at_a_terminal_then_a_kill_and_the_run_goes_on(undisturbed, tmp_path):
    folder, temporary = tmp_path / "a run", tmp_path / "temporary"
    terminal = Terminal(tmp_path, *SMALL, f"hydra.run.dir='{folder}'")
    wait_until(lambda: stored(folder, "WHERE status = 'ok'") > 0, terminal.run)
    processes = family(terminal.run.pid)
    assert len(processes) > 1
    assert list(temporary.iterdir())
    terminal.type(b"\x03")
    code, said = terminal.end()
    assert code == 130
    assert all_gone(processes)
    assert not left_in(temporary)
    assert "Traceback" not in said
    # How far a generation is would come after three seconds.
    assert "2 generations of up to 6 candidates" in said
    *_, last, empty = re.split(r"[\r\n]+", said)
    assert last == f"interrupted; to go on: python -m core.run resume='{folder}'"
    assert empty == ""
    assert json.loads((folder / "result.json").read_text())["stopped"] == "interrupted"
    assert (folder / "best" / "design.json").exists()

    command = shlex.split(last.partition("python -m ")[2])
    assert command == ["core.run", f"resume={folder}"]
    run = start(
        tmp_path, "run", *command[1:], "executor.workers=1", env=temporary_in(temporary)
    )
    kill(run, folder, stored(folder))
    assert go_on(folder).splitlines()[-1] == str(folder / "best")
    assert_same_run(folder, undisturbed)


# --- kill -------------------------------------------------------------------------------------------------------


def kill(run, folder, more_than):
    """Kill a run when more candidates are stored; no process is left."""
    wait_until(lambda: stored(folder) > more_than, run)
    processes = family(run.pid)
    run.kill()
    assert finished(run)[0] == -signal.SIGKILL
    assert all_gone(processes)


# --- SIGTERM ----------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_a_sweep_that_is_terminated(tmp_path):
    """As a scheduler does, which signals every process of the group."""
    folder = tmp_path / "sweep"
    words = [word for word in SMALL if not word.startswith("seed=")]
    run = start(
        tmp_path,
        "run",
        "-m",
        *words,
        "seed=5,6",
        f"hydra.sweep.dir={folder}",
        "hydra.sweep.subdir=${seed}",
    )
    wait_until(lambda: stored(folder / "5") > 0, run)
    processes = family(run.pid)
    os.killpg(run.pid, signal.SIGTERM)
    code, out, err = finished(run)
    assert code == 130
    assert all_gone(processes)
    assert "best" not in out
    assert (
        err.splitlines()[-1]
        == f"interrupted; to go on: python -m core.run resume={folder / '5'}"
    )
    assert not (folder / "6").exists()


@pytest.mark.thorough
def test_an_evaluation_that_is_terminated(tmp_path):
    document = json.loads(
        (ROOT / "tests" / "tasks" / "solutions" / "BringCube.json").read_text()
    )
    (plan,) = document["strategies"][0]["action_sets"]
    plans = [[[x + 1e-4 * i, *others] for x, *others in plan] for i in range(400)]
    document["strategies"][0]["action_sets"] = plans
    (tmp_path / "designs.json").write_text(json.dumps(document))
    temporary = tmp_path / "temporary"
    words = ["task=BringCube", "designs=designs.json", "executor.workers=2"]
    run = start(tmp_path, "evaluate", *words, env=temporary_in(temporary))
    wait_until(lambda: len(family(run.pid)) > 2, run)
    assert list(temporary.iterdir())
    processes = family(run.pid)
    run.send_signal(signal.SIGTERM)
    assert finished(run) == (130, "", "interrupted\n")
    assert all_gone(processes)
    assert not left_in(temporary)

"""Real runs in processes of their own, which tests interrupt and kill."""

import os
import sqlite3
import subprocess
import sys
import time
from contextlib import closing

import pytest

SMALL = [
    "task=BringCube",
    "budget=tiny",
    "budget.n_tool=2",
    "budget.n_action=3",
    "budget.n_iteration=1",
]
SMALL += ["film=false", "seed=5", "prompt.picture=false", "listener=[progress]"]
PATIENCE_S = 180


def start(folder, command, *words, **settings):
    """Start ``python -m core.COMMAND words...`` in its own process group."""
    words = [sys.executable, "-m", f"core.{command}", *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **settings}
    return subprocess.Popen(
        words, cwd=folder, text=True, start_new_session=True, **pipes
    )


def temporary_in(folder):
    """Return an environment with a new folder for temporary files."""
    folder.mkdir(exist_ok=True)
    return os.environ | {"TMPDIR": str(folder)}


def left_in(folder):
    """Return what is still there after a while."""
    deadline = time.monotonic() + 20
    while (found := list(folder.iterdir())) and time.monotonic() < deadline:
        time.sleep(0.05)
    return found


def stored(folder, which=""):
    """Return the number of stored candidates; ``which``: a WHERE clause."""
    try:
        with closing(
            sqlite3.connect(f"file:{folder / 'run.sqlite'}?mode=ro", uri=True)
        ) as database:
            return database.execute(
                f"SELECT count(*) FROM evaluations {which}"
            ).fetchone()[0]
    except sqlite3.Error:
        return 0


def wait_until(what, process):
    deadline = time.monotonic() + PATIENCE_S
    while not what():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.02)


def living():
    """Return the parent of every process that is no zombie."""
    done = subprocess.run(
        ["ps", "-A", "-o", "pid=,ppid=,stat="],
        capture_output=True,
        text=True,
        check=True,
    )
    rows = [line.split() for line in done.stdout.splitlines()]
    return {int(own): int(parent) for own, parent, state in rows if state[0] != "Z"}


def family(pid):
    """Return a process and its descendants."""
    parents, found = living(), [pid]
    for one in found:
        found += [own for own, parent in parents.items() if parent == one]
    return found


def all_gone(pids):
    """Wait for processes to end; report whether they did within 20 s."""
    deadline = time.monotonic() + 20
    while set(pids) & set(living()) and time.monotonic() < deadline:
        time.sleep(0.05)
    return not set(pids) & set(living())


def finished(process):
    """Wait for the end; return exit code, standard output and standard error."""
    out, err = process.communicate(timeout=PATIENCE_S)
    assert "Traceback" not in err
    return process.returncode, out, err


def go_on(folder, *words):
    code, out, err = finished(start(folder.parent, "run", f"resume={folder}", *words))
    assert code == 0, err
    return out


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory):
    """A run without interruption."""
    folder = tmp_path_factory.mktemp("undisturbed")
    temporary = folder / "temporary"
    run = start(folder, "run", *SMALL, "hydra.run.dir=run", env=temporary_in(temporary))
    code, _, err = finished(run)
    assert code == 0, err
    assert not list(temporary.iterdir())
    return folder / "run"

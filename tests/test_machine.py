"""Real runs whose machine fails them: no verdict on a design comes of it, and nothing is left behind."""

import contextlib
import sqlite3
import time

import pytest

from tests.support.disks import mount
from tests.support.processes import (
    SMALL,
    finished,
    go_on,
    start,
    stored,
    temporary_in,
    wait_until,
)
from tests.support.runs import assert_same_run

pytestmark = pytest.mark.slow


def begin(folder, temporary, *words):
    """Start a run whose temporary files go to another folder."""
    words = [*SMALL, f"hydra.run.dir={folder}", "executor.workers=2", *words]
    return start(folder.parent, "run", *words, env=temporary_in(temporary))


@pytest.mark.weekly
def test_a_disk_that_is_full_ends_the_run_and_it_goes_on(undisturbed, disk):
    folder = disk.parent / "run"
    mount("-t", "tmpfs", "-o", "size=2m", "tests", str(disk))
    run = begin(folder, disk)
    wait_until(lambda: stored(folder) > 0, run)
    while run.poll() is None:  # a worker that ends leaves room
        with contextlib.suppress(OSError), (disk / "much").open("ab") as file:
            file.write(bytes(2**21))
        time.sleep(0.01)
    code, out, err = finished(run)
    assert (code, out) == (1, "")
    (line,) = [line for line in err.splitlines() if line.startswith("error: ")]
    assert "No space left" in line
    assert line.endswith(f"to go on: python -m core.run resume={folder}")
    assert "failed" not in statuses(folder)
    go_on(folder)
    assert_same_run(folder, undisturbed)


def statuses(folder):
    file = folder / "run.sqlite"
    return [
        status
        for (status,) in sqlite3.connect(file).execute("SELECT status FROM evaluations")
    ]

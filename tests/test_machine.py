"""Real runs whose machine fails them: no verdict on a design comes of it, and nothing is left behind."""

import contextlib
import shutil
import sqlite3
import time

import numpy as np
import pytest

from core.design import Candidate, Component, Tool
from core.geometry import Box, Pose
from core.interfaces import RolloutSettings
from core.plugins import installed
from core.simulation.rollout import evaluate_batch
from core.support.scratch import scratch
from tests.disks import mount
from tests.engines import every_simulator, simulator
from tests.processes import SMALL, finished, go_on, left_in, start, stored, temporary_in, wait_until
from tests.test_resume import assert_same_run

pytestmark = pytest.mark.slow


def begin(folder, temporary, *words):
    """Start a run whose temporary files go to another folder."""
    words = [*SMALL, f"hydra.run.dir={folder}", "executor.workers=2", *words]
    return start(folder.parent, "run", *words, env=temporary_in(temporary))


def emptied(folder):
    for entry in folder.iterdir():
        shutil.rmtree(entry, ignore_errors=True)


@pytest.mark.thorough
def test_a_temporary_folder_that_is_cleaned_changes_nothing(undisturbed, tmp_path):
    run = begin(tmp_path / "run", tmp_path / "temporary")
    wait_until(lambda: stored(tmp_path / "run") > 0, run)
    emptied(tmp_path / "temporary")
    code, _, err = finished(run)
    assert code == 0, err
    assert not left_in(tmp_path / "temporary")
    assert_same_run(tmp_path / "run", undisturbed)


@pytest.mark.thorough
@every_simulator
def test_an_engine_whose_files_are_deleted_writes_them_again(engine):
    """The second rollout shares all files with the first; an engine may report none that is missing."""
    task, sim = installed().create("task", "HighObject"), simulator(engine)
    tool = Tool((Component("rod", "tool_mount", Pose(np.array([0.0, 0.0, -0.05])), Box((0.02, 0.02, 0.1))),))
    candidate = Candidate(tool, np.array([[0.5, 0.1, 0.4, 0.0, 0.0, 0.0]]), 0, 0)
    settings = RolloutSettings(settle_s=0.1, hold_s=0.1)

    def tried():
        (evaluation,) = evaluate_batch(task, sim, [candidate], 0, settings)
        return evaluation.status, evaluation.reward, evaluation.moved_m

    first = tried()
    picture = sim.render(task, seed=0)
    for file in [file for file in scratch().rglob("*") if file.is_file()]:
        file.unlink()
    assert tried() == first
    assert (sim.render(task, seed=0) == picture).all()
    shutil.rmtree(scratch())
    assert tried() == first


@pytest.mark.thorough
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
    return [status for (status,) in sqlite3.connect(file).execute("SELECT status FROM evaluations")]
